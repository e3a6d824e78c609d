#![no_main]

use kerrlight_vlbi::files::{read_uvfits, write_uvfits};
use libfuzzer_sys::fuzz_target;

// What can be read can be written, if it has all that the format needs, and read again.
fuzz_target!(|bytes: &[u8]| {
    let Ok(observation) = read_uvfits(bytes) else { return };
    let Ok(written) = write_uvfits(&observation) else { return };
    let _ = read_uvfits(&written);
});
