// From numbers to pixels: linear, logarithmic and normal-deviate scales with round ticks.
"use strict";

(() => {
  /** Round numbers that divide a span into about so many parts. */
  page.ticks = (low, high, count = 6) => {
    const step = page.roundStep((high - low) / count);
    const first = Math.ceil(low / step - 1e-9);
    const last = Math.floor(high / step + 1e-9);
    return Array.from({ length: Math.max(last - first + 1, 0) }, (_, place) => Number(((first + place) * step).toPrecision(12)));
  };

  /** 1, 2 or 5 times a power of ten, the least that is not below a number. */
  page.roundStep = (rough) => {
    if (!(rough > 0)) return 1;
    const power = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * (1 - 1e-9));
  };

  page.linear = ([low, high], [from, to]) => {
    const span = high - low || 1;
    const scale = (value) => from + ((value - low) / span) * (to - from);
    scale.ticks = (count) => page.ticks(low, high, count);
    return scale;
  };

  page.logarithmic = ([low, high], [from, to]) => {
    const [bottom, top] = [Math.log10(low), Math.log10(high)];
    const scale = (value) => from + ((Math.log10(Math.max(value, low)) - bottom) / (top - bottom || 1)) * (to - from);
    scale.ticks = (count = 6) => {
      const factors = top - bottom > count ? [1] : top - bottom > 2.2 ? [1, 3] : [1, 2, 5];
      const found = [];
      for (let power = Math.floor(bottom); power <= Math.ceil(top); power += 1) {
        for (const factor of factors) {
          const value = Number((factor * 10 ** power).toPrecision(12));
          if (value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9)) found.push(value);
        }
      }
      return found.length > 2 ? found : page.ticks(low, high, count);
    };
    return scale;
  };

  /** The normal deviate of a probability: the rational approximation of Acklam, relative error below 1.2e-9. */
  page.probit = (p) => {
    const a = [-3.969683028665376e1, 2.209460984245205e2, -2.759285104469687e2, 1.38357751867269e2, -3.066479806614716e1, 2.506628277459239];
    const b = [-5.447609879822406e1, 1.615858368580409e2, -1.556989798598866e2, 6.680131188771972e1, -1.328068155288572e1];
    const c = [-7.784894002430293e-3, -3.223964580411365e-1, -2.400758277161838, -2.549732539343734, 4.374664141464968, 2.938163982698783];
    const d = [7.784695709041462e-3, 3.224671290700398e-1, 2.445134137142996, 3.754408661907416];
    const along = (factors, x) => factors.reduce((sum, factor) => sum * x + factor, 0);
    if (p < 0.02425) {
      const q = Math.sqrt(-2 * Math.log(p));
      return along(c, q) / (along(d, q) * q + 1);
    }
    if (p > 0.97575) return -page.probit(1 - p);
    const q = p - 0.5;
    const r = q * q;
    return (along(a, r) * q) / (along(b, r) * r + 1);
  };

  page.deviate = ([low, high], [from, to]) => {
    const inner = page.linear([page.probit(low), page.probit(high)], [from, to]);
    const scale = (value) => inner(page.probit(Math.min(Math.max(value, low), high)));
    const marks = [0.0001, 0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999];
    scale.ticks = () => marks.filter((mark) => mark >= low && mark <= high);
    return scale;
  };
})();
