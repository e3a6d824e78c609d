//! Rows that are made each time in place of being kept.

use super::super::rows::Held;
use super::*;
use crate::fit::Observable;
use crate::representation::Allowed;
use kerrlight_render::polarization::StokesParameter;

/// Counts the frames that are kept, made each time and walked through.
fn counts(operator: &Operator<'_, f64>) -> [usize; 3] {
    let mut counts = [0; 3];
    for held in &operator.rows {
        let which = match held {
            Held::Kept(_) => 0,
            Held::Made => 1,
            Held::Walked => 2,
        };
        counts[which] += 1;
    }
    counts
}

/// All that an operator does, of pseudo-random numbers.
fn all_of(operator: &Operator<'_, f64>) -> Vec<f64> {
    let pixels = FRAMES.len() * operator.pixels;
    let term = ImageTerm::new(random(pixels, 6), operator.pixels, 0.3).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let data = Data::new(&terms, &FRAMES, operator.pixels, FRAMES.len()).unwrap();
    let (x, slopes) = (random(operator.active.count(), 1), random(pixels, 2));
    let (value, gradient) = operator.value_and_gradient(&data, &x, false);
    let curvature = operator.curvature(&data, None, &x);
    let parts = [operator.images(&x), operator.adjoint(&slopes), operator.squares(), curvature];
    [vec![value, operator.flux(&x)], gradient, parts.concat()].concat()
}

/// The same bits with rooms for all rows, for those of some frames and for none.
fn assert_room_changes_no_bit(model: &ForwardModel<f64>, knots: Knots, degree: Degree) {
    let voxels = Voxels { nodes: [7, 6, 8], ..Voxels::cube(4, 5.0, degree) };
    let is_active: Vec<bool> =
        random(knots.count * voxels.count(), 4).iter().map(|x| *x < 0.6).collect();
    let within = |room| {
        let active = Active::new(&is_active, &voxels.corners(), 0);
        let walk = Walk::new(model, axis(), voxels, knots);
        Operator::within(walk, active, &FRAMES, [usize::MAX, room])
    };
    let kept = within(usize::MAX);
    assert_eq!(counts(&kept), [5, 0, 0]);
    let mixed = (1..20).map(|part| within(part * kept.bytes() / 10)).find(|operator| {
        let [few, rest, none] = counts(operator);
        few >= 1 && rest >= 1 && none == 0
    });
    let some = mixed.expect("a room for some of the frames");
    assert!(some.bytes() < kept.bytes());
    let made = within(0);
    assert_eq!((counts(&made), made.bytes()), ([0, 5, 0], 0));
    let bits = |operator| all_of(operator).into_iter().map(f64::to_bits).collect::<Vec<u64>>();
    let expected = bits(&kept);
    assert!(expected.iter().filter(|bits| **bits != 0).count() > 100);
    assert!(bits(&some) == expected && bits(&made) == expected, "{degree:?}");
}

#[test]
fn exact_rows_that_are_made_again_are_those_that_are_kept() {
    for degree in [Degree::Linear, Degree::Cubic] {
        assert_room_changes_no_bit(&forward_model(), Knots::STEADY, degree);
    }
    assert_room_changes_no_bit(&falling_model(), Knots::STEADY, Degree::Linear);
    for allowed in [Allowed::Any, Allowed::Births] {
        let knots = Knots { first: 0.05, spacing: 0.2, count: 4, allowed };
        assert_room_changes_no_bit(&forward_model(), knots, Degree::Linear);
    }
    let flux = forward_model().seen(None, &Observable::Fluxes(vec![StokesParameter::I])).unwrap();
    assert_room_changes_no_bit(&flux, Knots::STEADY, Degree::Linear);
}

/// The budget alone decides where rows end and walks begin.
#[test]
fn exact_room_does_not_decide_what_is_walked() {
    let model = forward_model();
    let voxels = Voxels::cube(6, 5.0, Degree::Linear);
    let frames: Vec<usize> = FRAMES.iter().copied().cycle().take(40).collect();
    let within = |room, budget| {
        let active = Active::new(&vec![true; voxels.count()], &voxels.corners(), 0);
        let walk = Walk::new(&model, axis(), voxels, Knots::STEADY);
        Operator::within(walk, active, &frames, [budget, room])
    };
    let all = within(usize::MAX, usize::MAX).bytes();
    let walked = |room, budget| counts(&within(room, budget));
    assert_eq!(walked(usize::MAX, all / 2), [24, 0, 16]);
    assert_eq!(walked(0, all / 2), [0, 24, 16]);
    let [kept, made, none] = walked(all / 4, all / 2);
    assert!(kept > 0 && made > 0 && none == 16, "{kept} {made} {none}");
}
