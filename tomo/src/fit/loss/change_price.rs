//! Price of change while matter carries emission, for representations that are learnt: ∫∫ |∂e/∂t| dV dt at a fixed place of
//! matter at the reference time. The linear problem has the same price ([`Change`](crate::fit::linear::Change)).

use crate::fit::Field;
use crate::fit::forward::sightlines::Region;
use crate::representation::{Gradient, Knots, Workspace};
use kerrlight_common::simd::Float;
use kerrlight_render::points::Coordinates;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// The price of change, in units of the loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangePrice {
    /// Factor on ∫∫ |∂e/∂t| dV dt, per M³ of emission.
    pub weight: f64,
    /// Times that emission is compared at.
    pub knots: Knots,
    /// True if emission is linear between the knots. Else it is compared at times as far apart, anywhere between the first
    /// and the last of them.
    pub linear: bool,
    /// Region in which emission is looked for.
    pub region: Region,
}

/// Places and pairs of times of a step.
const PAIRS: usize = 4096;

/// Differences of emission are smoothed below this.
const SMOOTH: f64 = 1e-3;

/// Buffers that are kept from one step to the next.
#[derive(Default)]
pub struct ChangeBuffers<T> {
    /// Time and place of both ends of each pair: all earlier ones, then all later ones.
    columns: [Vec<T>; 4],
    values: Vec<T>,
    slopes: Vec<T>,
}

impl ChangePrice {
    /// The price by random places and times, the same for the same seed; adds its gradient. Places are drawn where the mask
    /// of what shines says that anything may.
    pub fn value_and_gradient<T: Float>(
        &self,
        field: Field<'_, T>,
        seed: u64,
        gradient: &mut [T],
        buffers: &mut ChangeBuffers<T>,
        workspace: &mut Workspace,
    ) -> f64 {
        let volume = self.place(field, seed, buffers);
        let ChangeBuffers { columns: [t, x, y, z], values, slopes } = buffers;
        values.clear();
        values.resize(t.len(), T::zero());
        let at = || Coordinates::txyz(t, x, y, z);
        field.representation.eval_recorded(field.parameters, at(), values, workspace);
        let pairs = t.len() / 2;
        // A pair stands for its part of the volume and of all spacings of knots. Those left out
        // count as well: nothing changes there.
        let factor = self.weight * volume * (self.knots.count - 1) as f64 / PAIRS as f64;
        slopes.clear();
        slopes.resize(t.len(), T::zero());
        let mut sum = 0.0;
        for k in 0..pairs {
            let difference = (values[k + pairs] - values[k]).double();
            let root = difference.hypot(SMOOTH);
            sum += root - SMOOTH;
            let slope = T::of(factor * difference / root);
            (slopes[k], slopes[k + pairs]) = (-slope, slope);
        }
        let into = Gradient { parameters: gradient, coordinates: None };
        field.representation.vjp_recorded(field.parameters, at(), slopes, into, workspace);
        factor * sum
    }

    /// Draws pairs; the volume that [`PAIRS`] of them stand for, M³. Those whose matter never passes the region are left out.
    fn place<T: Float>(
        &self,
        field: Field<'_, T>,
        seed: u64,
        buffers: &mut ChangeBuffers<T>,
    ) -> f64 {
        let mut random = Pcg64::seed_from_u64(seed);
        let half = self.region.r_max;
        let lit = field.occupancy.map(|mask| (mask, mask.lit()));
        let columns = &mut buffers.columns;
        columns.iter_mut().for_each(Vec::clear);
        let mut starts = Vec::with_capacity(PAIRS);
        for _ in 0..PAIRS {
            let place = match &lit {
                Some((mask, lit)) => mask.draw(lit, &mut random),
                None => [0, 1, 2].map(|_| random.random_range(-half..half)),
            };
            let time = self.time(&mut random);
            if self.region.is_passed(field.axis.vector(), place, 0.0) {
                starts.push(time);
                let [_, to @ ..] = columns;
                to.iter_mut().zip(place).for_each(|(column, x)| column.push(T::of(x)));
            }
        }
        let [time, places @ ..] = columns;
        time.extend(starts.iter().map(|t| T::of(*t)));
        time.extend(starts.iter().map(|t| T::of(t + self.knots.spacing)));
        places.iter_mut().for_each(|column| column.extend_from_within(..));
        match &lit {
            Some((mask, lit)) => lit.len() as f64 * mask.cell_width().powi(3),
            None => (2.0 * half).powi(3),
        }
    }

    /// The earlier time of a pair, M since the reference time.
    fn time(&self, random: &mut Pcg64) -> f64 {
        let Knots { first, spacing, count, .. } = self.knots;
        let steps = match self.linear {
            true => random.random_range(0..count - 1) as f64,
            // The later time of a pair is a spacing on, and still before the last knot.
            false => random.random::<f64>() * (count - 2) as f64,
        };
        first + steps * spacing
    }
}

#[cfg(test)]
mod tests;
