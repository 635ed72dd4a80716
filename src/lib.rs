//! Terrasoar.
