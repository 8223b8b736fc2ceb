"""Arrays of a stranger: read within limits, and damage is told in one line."""

import io
import zipfile

import numpy as np
import pytest

from spoofgym.archive import read_arrays


def npy(header, body=b""):
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + body


def write(path, members, **options):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content, **options)


def test_arrays_come_back(tmp_path):
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b": np.array(["x", "yz"]), "c": np.asfortranarray(np.eye(3)[:, :2])}
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "x.npz", **arrays)
        read = read_arrays(tmp_path / "x.npz")
        assert set(read) == set(arrays)
        for name, array in arrays.items():
            np.testing.assert_array_equal(read[name], array)


HEADER = "{{'descr': '<f4', 'fortran_order': False, 'shape': {}, }}"


@pytest.mark.parametrize(
    ("member", "words"),
    [
        (npy(HEADER.format("(1000000000000,)"), bytes(8)), "does not fit its 8 bytes"),
        (npy(HEADER.format("(2, -1)"), bytes(8)), "damaged"),
        (npy(HEADER.format("(1,)"), bytes(8)), "does not fit its 8 bytes"),
        (npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"\x80\x04N."), "allow_pickle=False"),
        (npy("__import__('os').getcwd()"), "damaged"),
        (b"no array", "damaged"),
        (b"", "damaged"),
    ],
)
def test_a_header_is_not_believed(tmp_path, member, words):
    path = tmp_path / "x.npz"
    write(path, {"a.npy": member})
    with pytest.raises(ValueError, match=words) as raised:
        read_arrays(path)
    assert str(raised.value).startswith(f"{path} is damaged: ")
    assert "\n" not in str(raised.value)


def test_a_small_file_does_not_unpack_to_any_size(tmp_path):
    path = tmp_path / "x.npz"
    write(path, {"a.npy": npy(HEADER.format("(25000000,)"), bytes(10**8))})
    assert path.stat().st_size < 10**6
    with pytest.raises(ValueError, match="unpacks to 100000128 bytes in 1 parts, more than are read"):
        read_arrays(path)


def test_too_many_parts_are_refused(tmp_path):
    write(tmp_path / "x.npz", {f"{i}.npy": b"" for i in range(1001)})
    with pytest.raises(ValueError, match="in 1001 parts"):
        read_arrays(tmp_path / "x.npz")


@pytest.mark.parametrize("place", range(0, 100, 3))
def test_a_flipped_byte_is_seen(tmp_path, place):
    """In the array, whose checksum is then wrong, or in what says where it lies."""
    content = io.BytesIO()
    np.savez(content, a=np.random.default_rng(place).normal(size=200).astype(np.float32))
    damaged = bytearray(content.getvalue())
    damaged[200 + 6 * place] ^= 0x55
    (tmp_path / "x.npz").write_bytes(bytes(damaged))
    with pytest.raises(ValueError, match=r"x\.npz is damaged: "):
        read_arrays(tmp_path / "x.npz")
