#![no_main]

use kerrlight_vlbi::files::{parse_obs_text, to_obs_text};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(observation) = parse_obs_text(text) {
        let _ = to_obs_text(&observation);
    }
});
