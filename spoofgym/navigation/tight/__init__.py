"""The tightly coupled filter: ranges to satellites correct an inertial solution."""
