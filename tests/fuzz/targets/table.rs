#![no_main]

use kerrlight_tomo::interferometry::files::{parse_table, to_csv};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(observation) = parse_table(text) {
        let _ = to_csv(&observation);
    }
});
