//! Many processes on one folder, some of which are killed.

use super::queue::Queue;
use super::{Board, Claims, Record, Watch, workers};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn exact_a_piece_is_taken_once() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [0, 1].map(|_| Claims::join(folder.path()).unwrap());
    assert_ne!(a.name(), b.name());
    assert_eq!(workers(folder.path()).len(), 2);
    let claim = a.take("piece", 0).unwrap().unwrap();
    assert!(b.take("piece", 0).unwrap().is_none());
    // An answer that was lost: the same request again.
    assert_eq!(a.take("piece", 0).unwrap(), Some(claim.clone()));
    assert!(a.holds(&claim));
    assert!(!Board::read(folder.path()).unwrap().of("piece").is_free());
    a.free(&claim).unwrap();
    assert!(Board::read(folder.path()).unwrap().of("piece").is_free());
    let second = b.take("piece", 1).unwrap().unwrap();
    assert!(!a.holds(&claim) && b.holds(&second));
    b.done(&second, 1.0).unwrap();
    assert!(Board::read(folder.path()).unwrap().of("piece").done);
    drop(a);
    assert_eq!(workers(folder.path())[0].worker, b.name());
}

#[test]
fn exact_a_failure_has_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut queue = Queue::join(folder.path(), vec!["a".to_owned(), "b".to_owned()]).unwrap();
    let (at, claim) = queue.next().unwrap().unwrap();
    assert_eq!((at, claim.piece.as_str(), queue.open()), (0, "a", 2));
    queue.failed((at, &claim), "no room").unwrap();
    assert_eq!(super::reason(folder.path(), "a"), "no room");
    let (at, _) = queue.next().unwrap().unwrap();
    assert_eq!((at, queue.open()), (1, 1));
    assert!(queue.next().unwrap().is_none(), "what is taken is not taken again");
}

/// What costs most goes first; what is not known yet goes before it, in order.
#[test]
fn exact_pieces_of_the_highest_cost_are_taken_first() {
    let folder = tempfile::tempdir().unwrap();
    let pieces = ["a", "b", "c", "d", "e", "f"].map(str::to_owned).to_vec();
    let mut queue = Queue::join(folder.path(), pieces).unwrap();
    let (at, claim) = queue.next().unwrap().unwrap();
    queue.done((at, &claim), 1.0).unwrap();
    let costs = [1.0, f64::INFINITY, 2.0, 1.0, 3.0, f64::INFINITY];
    queue.prefer(|at| costs[at]);
    let order: Vec<usize> =
        std::iter::from_fn(|| queue.next().unwrap().map(|(at, _)| at)).collect();
    assert_eq!(order, [1, 5, 4, 2, 3]);
}

/// A file system without hard links: claims are made and filled in two steps.
#[test]
fn exact_claims_without_links() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [0, 1].map(|_| Claims::join(folder.path()).unwrap());
    let path = a.at("piece.0");
    assert!(a.create_without_link(&path).unwrap());
    assert!(!b.create_without_link(&path).unwrap());
    assert!(a.create_without_link(&path).unwrap());
    assert_eq!(Record::load(&path).unwrap().worker, a.name());
}

/// Of a worker on another machine only its record is seen: it is dead when that stays the same for long, by the
/// clock of whoever looks.
#[test]
fn exact_a_record_that_stays_the_same_is_of_a_dead_worker() {
    let folder = tempfile::tempdir().unwrap();
    let claims = Claims::join(folder.path()).unwrap();
    let claim = claims.take("piece", 0).unwrap().unwrap();
    let path = folder.path().join("workers").join(format!("{}.json", claims.name()));
    let mut elsewhere: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    elsewhere["process"]["machine"] = "another".into();
    elsewhere["every_s"] = 0.02.into();
    let renew = |beat: u64| {
        let mut now = elsewhere.clone();
        now["beat"] = beat.into();
        fs::write(&path, now.to_string()).unwrap();
    };
    let mut watch = Watch::new(folder.path());
    for beat in 0..20 {
        renew(beat);
        assert!(!watch.is_abandoned("piece", claim.turn), "{beat}");
        std::thread::sleep(Duration::from_millis(20));
    }
    let clock = Instant::now();
    while !watch.is_abandoned("piece", claim.turn) {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(clock.elapsed() > Duration::from_millis(90), "{:?}", clock.elapsed());
    // One that comes back lives.
    renew(1000);
    assert!(!watch.is_abandoned("piece", claim.turn));
}

/// The variable that makes a process of [`worker`].
const SHARED: &str = "KERRLIGHT_TEST_SHARED";
const PIECES: usize = 1000;

/// A process that the test below starts and kills: each piece is a file that is written in parts and then linked to
/// its place, where there must be none.
#[test]
fn worker() {
    let Ok(folder) = std::env::var(SHARED) else { return };
    let folder = Path::new(&folder);
    let pieces = (0..PIECES).map(|k| format!("piece_{k:04}")).collect();
    let mut queue = Queue::join(&folder.join("shared"), pieces).unwrap();
    while queue.open() > 0 {
        let Some((at, claim)) = queue.next().unwrap() else {
            std::thread::sleep(Duration::from_millis(20));
            continue;
        };
        let place = folder.join("done").join(&claim.piece);
        if !place.exists() {
            let work = folder.join("work").join(format!("{}.{}", claim.piece, claim.turn));
            fs::write(&work, &claim.piece).unwrap();
            std::thread::sleep(Duration::from_millis(2));
            match fs::hard_link(&work, &place) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    fs::write(folder.join("twice"), &claim.piece).unwrap();
                }
                linked => linked.unwrap(),
            }
        }
        queue.done((at, &claim), 0.002).unwrap();
    }
}

fn start(folder: &Path) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "claims::tests::worker"]).env(SHARED, folder);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Four processes, of which one is killed every now and then and another takes its place, do each of a thousand
/// pieces once.
#[test]
fn exact_killed_workers_lose_nothing_and_do_nothing_twice() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["done", "work"] {
        fs::create_dir(at.join(name)).unwrap();
    }
    let mut all: Vec<Child> = (0..4).map(|_| start(at)).collect();
    let (clock, mut kills) = (Instant::now(), 0);
    while all.iter_mut().any(|child| child.try_wait().unwrap().is_none()) {
        assert!(clock.elapsed() < Duration::from_secs(300), "they do not end");
        std::thread::sleep(Duration::from_millis(150));
        let done = fs::read_dir(at.join("done")).unwrap().count();
        if done < PIECES {
            // Some stay behind as zombies, which are as dead.
            all[kills % 4].kill().unwrap();
            let new = start(at);
            all.push(new);
            let last = all.len() - 1;
            all.swap(kills % 4, last);
            kills += 1;
        }
    }
    assert!(all.iter_mut().take(4).all(|child| child.wait().unwrap().success()));
    assert_eq!(fs::read_dir(at.join("done")).unwrap().count(), PIECES);
    assert!(!at.join("twice").exists());
    let board = Board::read(&at.join("shared")).unwrap();
    assert!((0..PIECES).all(|k| board.of(&format!("piece_{k:04}")).done));
    assert!(kills > 2, "only {kills} kills");
}

/// A hundred thousand pieces are scheduled one by one, and how long that takes is printed.
#[test]
#[ignore = "long"]
fn regress_a_hundred_thousand_pieces() {
    let folder = tempfile::tempdir().unwrap();
    let clock = Instant::now();
    let pieces = (0..100_000).map(|k| format!("case_{k:06}")).collect();
    let mut queue = Queue::join(folder.path(), pieces).unwrap();
    while let Some((at, claim)) = queue.next().unwrap() {
        queue.done((at, &claim), 1.0).unwrap();
    }
    let all = clock.elapsed();
    let board = Board::read(folder.path()).unwrap();
    assert!((0..100_000).all(|k| board.of(&format!("case_{k:06}")).done));
    println!("{:.1} s, {:.1} µs a piece", all.as_secs_f64(), all.as_secs_f64() * 10.0);
}
