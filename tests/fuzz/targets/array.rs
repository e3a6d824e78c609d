#![no_main]

use kerrlight_vlbi::array::{parse, to_text};
use libfuzzer_sys::fuzz_target;

// An array that has been read is the same when written and read again.
fuzz_target!(|text: &str| {
    if let Ok(array) = parse(text) {
        assert_eq!(parse(&to_text(&array)), Ok(array));
    }
});
