//! How much tests try: all there is, or a part that says most of it.

/// Whether tests try all there is, which takes long: `./test --full` sets `TERRASOAR_THOROUGH`.
pub fn is_thorough() -> bool {
    std::env::var_os("TERRASOAR_THOROUGH").is_some()
}

/// All cases, or one in `few`, the first among them and always the same.
pub fn one_in<T>(few: usize, cases: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    cases.into_iter().step_by(if is_thorough() { 1 } else { few })
}
