//! Tests that touch two crates or the binary; see main.rs.

/// The examples of the tutorial compile and run.
#[cfg(doctest)]
#[doc = include_str!("../../docs/tutorials/embedding.md")]
mod embedding {}
