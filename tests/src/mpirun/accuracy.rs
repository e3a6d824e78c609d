//! Hard rays, shared by ranks.

use super::{kill_ranks, names, says, start_with};
use crate::support::succeed;

/// Hard rays come to the same with any number of ranks and after kills; the sweep, which measures times, is one rank's.
#[test]
#[ignore = "long"]
fn exact_ranks_of_mpirun_trace_hard_rays_together() {
    fn words(output: &str) -> [&str; 7] {
        ["accuracy", "--hard", "24000", "-o", output, "--threads", "1"]
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeed(at, &words("alone"));
    let same = |other: &str| {
        assert_eq!(names(&at.join("alone")), names(&at.join(other)), "{other}");
        for name in ["hard.json", "hard.csv"] {
            let [a, b] = ["alone", other].map(|folder| std::fs::read(at.join(folder).join(name)));
            assert!(a.unwrap() == b.unwrap(), "{other}/{name}");
        }
    };
    for ranks in [2, 4] {
        let output = format!("out{ranks}");
        let Some(_) = says(at, ranks, &words(&output)) else { return };
        same(&output);
    }
    kill_ranks(|ranks| start_with(at, ranks, &words("out")));
    same("out");
    let sweep = ["accuracy", "--rays", "8", "-o", "sweep", "--threads", "1"];
    let said = says(at, 3, &sweep).unwrap();
    assert_eq!(names(&at.join("sweep")).len(), 4, "{said}");
}
