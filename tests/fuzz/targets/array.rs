#![no_main]

use kerrlight_vlbi::array::parse;
use libfuzzer_sys::fuzz_target;

// A text is an array or an error.
fuzz_target!(|text: &str| {
    let _ = parse(text);
});
