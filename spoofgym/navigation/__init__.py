"""The navigation solution: strapdown mechanization, error model, Kalman filter and the navigators built from them."""
