//! Parsers on files that are cut, absurd or damaged: what they hold at once is at most 20 times the
//! file and a little, whatever its header says.

use kerrlight_vlbi::{array, files};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, which counts.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every request goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(now, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// One measurement at a time.
static TURN: Mutex<()> = Mutex::new(());

/// Names, messages and tables of a handful of headers.
const LITTLE: usize = 64 << 10;

/// Returns whether reading was a success; fails if it held too much at once.
fn bounded(name: &str, bytes: &[u8], read: impl Fn(&[u8]) -> bool) -> bool {
    let before = NOW.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let result = read(bytes);
    let peak = PEAK.load(Ordering::Relaxed) - before;
    let allowed = 20 * bytes.len() + LITTLE;
    assert!(peak <= allowed, "{name}: {peak} bytes for a file of {}", bytes.len());
    result
}

fn read_array(bytes: &[u8]) -> bool {
    core::str::from_utf8(bytes).is_ok_and(|text| array::parse(text).is_ok())
}

fn decode(bytes: &[u8]) -> bool {
    files::decode(bytes).is_ok()
}

fn read_image(bytes: &[u8]) -> bool {
    files::read_fits_image(bytes).is_ok()
}

fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let entries = std::fs::read_dir(&folder).expect("a corpus");
    entries
        .map(|entry| {
            let path = entry.expect("an entry").path();
            (path.display().to_string(), std::fs::read(&path).expect("a readable file"))
        })
        .collect()
}

#[test]
fn exact_memory_of_files_cut_at_every_byte() {
    let _turn = TURN.lock();
    let mut read = 0;
    for (target, parser) in
        [("uvfits", decode as fn(&[u8]) -> bool), ("obs_text", decode), ("table", decode)]
    {
        for (name, bytes) in corpus(target) {
            for end in 0..bytes.len() {
                read += usize::from(bounded(&name, &bytes[..end], parser));
                bounded(&name, &bytes[..end], read_image);
            }
            assert_eq!(bounded(&name, &bytes, parser), name.contains("good"), "{name}");
        }
    }
    for (name, bytes) in corpus("array") {
        for end in 0..bytes.len() {
            bounded(&name, &bytes[..end], read_array);
        }
        assert_eq!(bounded(&name, &bytes, read_array), name.contains("good"), "{name}");
    }
    assert!(read > 4, "{read}");
}

/// Every number of every header, one after the other, replaced by absurd ones, alone and with all
/// axes of length 1, so that sizes may still fit.
#[test]
fn exact_memory_of_absurd_headers() {
    let _turn = TURN.lock();
    let absurd = ["0", "-1", "65535", "1000000000", "9223372036854775807", "1E300", "NaN", "T"];
    let (mut errors, mut cases) = (0, 0);
    for (name, bytes) in corpus("uvfits") {
        for card in 0..bytes.len() / 80 {
            let at = card * 80;
            if &bytes[at + 8..at + 10] != b"= " || bytes[at + 10] == b'\'' {
                continue;
            }
            for value in absurd {
                let mut changed = bytes.clone();
                changed[at + 10..at + 30].copy_from_slice(format!("{value:>20}").as_bytes());
                for groups in [false, true] {
                    if groups {
                        no_groups(&mut changed);
                    }
                    errors += usize::from(!bounded(&name, &changed, decode));
                    bounded(&name, &changed, read_image);
                    cases += 1;
                }
            }
        }
    }
    assert!(cases > 2000 && errors > 200, "{errors} of {cases}");
}

/// Says that there are no groups, so that any size of one agrees with the file.
fn no_groups(bytes: &mut [u8]) {
    let at = bytes.windows(10).position(|window| window == b"GCOUNT  = ");
    if let Some(at) = at.filter(|at| at + 30 <= bytes.len()) {
        bytes[at + 10..at + 30].copy_from_slice(b"                   0");
    }
}

/// Lines as short as lines can be, and cells without end.
#[test]
fn exact_memory_of_absurd_texts() {
    let _turn = TURN.lock();
    let heading = "time_utc_h,t1,t2,u,v,re,im,sigma\n";
    let texts = [
        "\n".repeat(100_000),
        "#\n".repeat(100_000),
        ",".repeat(200_000),
        "# a b c d e f g h\n".repeat(20_000),
        heading.to_owned() + &"1,".repeat(100_000),
        heading.to_owned() + &"0,A,B,0,0,0,0,0\n".repeat(20_000),
        "# channel: 0 1 1\n".to_owned() + &"# history: x\n".repeat(20_000),
        "# SRC: A\n# RA: ".to_owned() + &" 1".repeat(100_000),
    ];
    for text in texts {
        let name: String = text.chars().take(40).collect();
        bounded(&name, text.as_bytes(), decode);
        bounded(&name, text.as_bytes(), read_array);
    }
}
