//! Nodes of a forward model as the device has them.

use super::fall;
use super::pixels::Node;
use crate::fit::forward::forward_model::ForwardModel;

/// All nodes; whether a field is `carried` by matter, that may fall.
pub fn nodes(model: &ForwardModel<f32>, is_carried: bool) -> impl Iterator<Item = Node> {
    let origins = model.fall.as_ref().filter(|_| is_carried).map(|fall| fall.parts().1);
    let motion = move |k: usize| {
        let delay = model.delay.get(k).copied().unwrap_or(0.0);
        let Some(origins) = origins else {
            return [model.rate[k], model.phase.get(k).copied().unwrap_or(0.0), delay, 0.0];
        };
        let [high, low, azimuth] = fall::of_node(&origins[k]);
        [high, low, delay, azimuth]
    };
    (0..model.points()).map(move |k| Node {
        place: [0, 1, 2].map(|c| model.position[c][k]),
        weight: model.weight[k],
        motion: motion(k),
    })
}
