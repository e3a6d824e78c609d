#![no_main]

use kerrlight_vlbi::files::{parse_table, to_csv};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(observation) = parse_table(text) {
        // What has been read is the same when written and read again.
        let text = to_csv(&observation, true).expect("what has been read is finite");
        let again = parse_table(&text).map(|again| again.rows.len());
        assert_eq!(again, Ok(observation.rows.len()), "{text}");
    }
});
