//! Synthetic fractal terrain.
