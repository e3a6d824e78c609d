//! The best field of one of many similar problems.

use super::*;
use crate::fit::linear::StopRule;

/// Bright nodes in a dark field: few iterations over all of them and many over those that shine come as near the minimum as many
/// over all.
#[test]
fn exact_few_nodes_that_shine_are_as_good_as_all() {
    let model = forward_model();
    let voxels = Voxels::cube(9, 5.0, Degree::Linear);
    let mut truth = vec![0.0; voxels.count()];
    for (k, x) in [(300, 2.0), (301, 1.0), (432, 3.0), (520, 0.7)] {
        truth[k] = x;
    }
    let clean = movie(&model, &voxels, &truth);
    let data = moved(&clean, &normal(clean.len(), 5), 0.05);
    let term = ImageTerm::new(data, model.pixels(), 0.05).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let problem = of_images(&model, &terms, voxels);
    let least = problem.least(None, 4000).unwrap();
    let how = StopRule { looking: 20, rounds: 4, settling: 1000 };
    let settled = problem.settled(None, how).unwrap();
    let few = problem.least(None, 20).unwrap();
    // Among 405 pixels, ten iterations that lower χ² by less than a hundredth of what noise does end a round.
    assert!(settled.value < 1.01 * least.value, "{} {}", settled.value, least.value);
    assert!(few.value > 1.05 * least.value, "{} {}", few.value, least.value);
    // From a field that is given: not even the nodes have to be the same.
    let mut moved = settled.x.clone();
    moved.rotate_right(1);
    let again = problem.settled(Some(&moved), how).unwrap();
    assert!(again.value < 1.01 * least.value, "{} {}", again.value, least.value);
    let plain = problem.settled(None, StopRule::looking(20)).unwrap();
    assert_eq!(plain.value, few.value);
}
