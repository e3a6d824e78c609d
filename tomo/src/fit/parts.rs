//! A step cut into parts, whose gradients begin at zero and are summed in one order: processes may take some each.
//!
//! Part k of n has the data ⌊k·count/n⌋ to ⌊(k + 1)·count/n⌋ of a step. Parts are added in pairs, halves first: the sum of
//! parts a to b is that of a to m plus that of m to b, m = ⌊(a + b)/2⌋. It is the same to the bit whoever computes which of
//! these sums, and whoever has several neighbouring parts gives away a few sums in place of all of them.

use super::forward_model::Field;
use super::objective::{Buffers, Gradients, Loss, Objective};
use super::selection::Selection;
use core::ops::Range;
use kerrlight_common::simd::Float;

/// Loss and gradient of some parts of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part<T> {
    /// With respect to the parameters.
    pub gradient: Vec<T>,
    /// With respect to the axis; zero if it is not learnt.
    pub of_axis: [f64; 3],
    /// Their share in the loss of the step.
    pub loss: Loss,
}

/// Processes that work on the same step, each on some of its parts. All of them have the same state before and after it.
pub trait Ranks<T>: Send {
    /// The parts of this process, of so many; those of all processes follow one another.
    fn mine(&self, parts: usize) -> Range<usize>;

    /// The sum over all `parts`, of which `own` has [`nodes`] of this process; `state` is a checksum of what all processes
    /// must have in common.
    fn sum(&mut self, parts: usize, state: u32, own: Vec<Part<T>>) -> Part<T>;
}

impl<T: Float> Part<T> {
    /// Adds the part that follows.
    pub fn add(&mut self, other: &Self) {
        self.gradient.iter_mut().zip(&other.gradient).for_each(|(sum, x)| *sum += *x);
        self.of_axis.iter_mut().zip(&other.of_axis).for_each(|(sum, x)| *sum += x);
        self.loss.total += other.loss.total;
        self.loss.terms.iter_mut().zip(&other.loss.terms).for_each(|(sum, x)| *sum += x);
        self.loss.points += other.loss.points;
    }
}

/// Share k of `shares` of `count` things in a row.
pub fn share(k: usize, shares: usize, count: usize) -> Range<usize> {
    k * count / shares..(k + 1) * count / shares
}

/// The largest sums over parts of `of` that have no part but `mine`, in order.
pub fn nodes(of: Range<usize>, mine: &Range<usize>) -> Vec<Range<usize>> {
    if of.is_empty() || of.end <= mine.start || mine.end <= of.start {
        return Vec::new();
    }
    if mine.start <= of.start && of.end <= mine.end {
        return vec![of];
    }
    let [left, right] = halves(&of);
    [nodes(left, mine), nodes(right, mine)].concat()
}

fn halves(of: &Range<usize>) -> [Range<usize>; 2] {
    let middle = of.start.midpoint(of.end);
    [of.start..middle, middle..of.end]
}

/// The sum over the parts of `of` from that of its [`nodes`], which are taken in order.
///
/// # Panics
/// If they end too early.
pub fn combine<T: Float>(
    of: Range<usize>,
    parts: &mut impl Iterator<Item = (Range<usize>, Part<T>)>,
) -> Part<T> {
    let mut parts = parts.peekable();
    combined(of, &mut |wanted| parts.next_if(|(range, _)| range == wanted).map(|(_, part)| part))
}

fn combined<T: Float>(
    of: Range<usize>,
    next: &mut dyn FnMut(&Range<usize>) -> Option<Part<T>>,
) -> Part<T> {
    if let Some(part) = next(&of) {
        return part;
    }
    assert!(of.len() > 1, "part {} is missing", of.start);
    let [left, right] = halves(&of);
    let mut sum = combined(left, next);
    sum.add(&combined(right, next));
    sum
}

/// A step that is cut into parts.
pub(super) struct Cut<'a, T> {
    pub objective: &'a Objective<T>,
    pub field: Field<'a, T>,
    pub selection: Selection<'a>,
    /// Whether the gradient of the axis is wanted.
    pub learnt: bool,
    /// How many parts there are.
    pub parts: usize,
    pub buffers: &'a mut Buffers<T>,
    /// Gradients that are no longer used.
    pub spare: &'a mut Vec<Vec<T>>,
}

impl<T: Float> Cut<'_, T> {
    /// The sum over the parts of a range.
    pub fn sum(&mut self, of: Range<usize>) -> Part<T> {
        if of.len() == 1 {
            return self.one(of.start);
        }
        let [left, right] = halves(&of);
        let mut sum = self.sum(left);
        let other = self.sum(right);
        sum.add(&other);
        self.spare.push(other.gradient);
        sum
    }

    fn one(&mut self, k: usize) -> Part<T> {
        let mut gradient = self.spare.pop().unwrap_or_default();
        gradient.clear();
        gradient.resize(self.field.parameters.len(), T::zero());
        let mut of_axis = [0.0; 3];
        let axis = self.learnt.then_some(&mut of_axis);
        let gradients = Gradients { parameters: &mut gradient, axis };
        let whole = self.selection.len();
        let part = self.selection.part(share(k, self.parts, whole));
        let loss = self.objective.share(self.field, (part, whole), gradients, self.buffers);
        Part { gradient, of_axis, loss }
    }
}
