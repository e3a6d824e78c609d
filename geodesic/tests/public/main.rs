//! Tests of the crate's public interface, as one program: it links once.

mod capi;
mod derivatives;
mod footprint;
mod hard;
mod kerr_schild;
mod misuse;
mod nodes;
mod parallel_transport;
mod requests;
