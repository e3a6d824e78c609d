//! Circular orbits and thin discs: tables of Bardeen, Press & Teukolsky (1972) and values of
//! Page & Thorne (1974).

use crate::report::Case;
use kerrlight_geodesic::{Kerr, orbits};
use kerrlight_render::emission::page_thorne::PageThorne;

const ORBITS: &str = "Bardeen, Press & Teukolsky 1972";
const DISC: &str = "Page & Thorne 1974";

/// All cases of this file.
pub fn cases() -> Vec<Case> {
    let hole = |a: f64| Kerr::new(a).expect("spins of the table"); // all within [−1, 1]
    let mut cases = Vec::new();
    let table = [
        (0.0, 6.0),
        (0.5, 4.2330025295),
        (-0.5, 7.5545847145),
        (0.9, 2.3208830418),
        (-0.9, 8.7173522797),
        (0.998, 1.2369706552),
        (-0.998, 8.9943744548),
    ];
    for (a, expected) in table {
        let name = format!("innermost stable orbit, a = {a}");
        cases.push(Case::number(ORBITS, name, expected, orbits::isco(&hole(a)), 5e-11));
    }
    for (a, expected) in [(0.0, 0.0571909584), (0.998, 0.3209941656)] {
        let name = format!("binding efficiency, a = {a}");
        let found = orbits::binding_efficiency(&hole(a));
        cases.push(Case::number(ORBITS, name, expected, found, 2e-9));
    }
    let (still, fast) = (PageThorne::new(&hole(0.0)), PageThorne::new(&hole(0.9)));
    let fluxes = [
        ("flux at r = 10, a = 0", 1.356875464e-5, still.flux(10.0)),
        ("flux at r = 100, a = 0", 7.785853592e-8, still.flux(100.0)),
        ("peak flux, a = 0", 1.367811082e-5, still.peak().1),
        ("peak flux, a = 0.9", 3.392286249e-4, fast.peak().1),
    ];
    for (name, expected, found) in fluxes {
        let mut case = Case::number(DISC, name, expected, found, 5e-10);
        (case.expected, case.found) = (format!("{expected:.9e}"), format!("{found:.9e}"));
        cases.push(case);
    }
    cases
}
