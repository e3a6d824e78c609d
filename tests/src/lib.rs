//! Tests that touch two crates or the binary; see main.rs.
