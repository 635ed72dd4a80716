//! Readers of elevation data: each turns one format into a [`DemSource`](crate::dem::DemSource).
