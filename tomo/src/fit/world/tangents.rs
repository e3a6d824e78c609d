//! How the nodes of all rays move with the parameters of the world.

use super::fall::{Fallen, Falls, Flowing};
use super::redshift::Gas;
use super::{Number, PARAMETERS, Parameter, World, WorldModel};
use crate::Error;
use crate::fit::pixel_rays::PixelRays;
use crate::fit::{Redshift, Sightlines};
use kerrlight_geodesic::derivatives::Gradient;
use kerrlight_geodesic::node_gradients::{DifferentiatedNode, DifferentiatedNodes};
use kerrlight_geodesic::{Elementary, Scalar};

/// Derivatives of what a node is to the forward model, with respect to one parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Move {
    /// Of its place, M.
    pub position: [f64; 3],
    /// Of its weight, redshift included, Jy a pixel.
    pub weight: f64,
    /// Of the rate by which it is turned back, radians per M.
    pub rate: f64,
    /// Of the time of emission in any frame, M.
    pub time: f64,
}

/// Derivatives of every node with respect to some parameters.
#[derive(Clone, Debug, Default)]
pub struct Tangents {
    /// The parameters.
    pub free: Vec<Parameter>,
    /// Of node k with respect to parameter p: `moves[k * free.len() + p]`.
    pub(super) moves: Vec<Move>,
    /// How matter is carried along that changes its radius; the moves' rates are then not used.
    pub(super) falls: Option<Falls>,
}

impl Tangents {
    /// The nodes inside the region, and how they move.
    pub(super) fn new(
        model: &WorldModel,
        (world, rays): (&World, &PixelRays),
        free: &[Parameter],
        nodes: &DifferentiatedNodes,
    ) -> Result<(Sightlines, Self), Error> {
        let pixels = rays.starts.len() - 1;
        let limits = Some(model.region.radii());
        let mut lines = Sightlines { pixels, starts: vec![0], limits, ..Sightlines::default() };
        let mut tangents = Tangents { free: free.to_vec(), ..Tangents::default() };
        let (numbers, flow) = (world.numbers(), Flowing::new(model, world)?);
        let mut builder =
            Builder { model, flow, numbers, ray: [Number::constant(0.0); 2], jy: 0.0 };
        let mut fallen = Vec::new();
        for pixel in 0..pixels {
            builder.jy = model.jy * rays.share(pixel);
            for ray in rays.starts[pixel]..rays.starts[pixel + 1] {
                builder.ray = model.place(&builder.numbers, rays.places[ray]);
                let nodes = nodes.ray(ray).iter();
                for node in nodes.filter(|node| model.region.holds(node.value.position)) {
                    builder.push(node, &mut lines);
                    let (moves, origin) = builder.moves(node);
                    fallen.extend(origin);
                    tangents.moves.extend(free.iter().map(|parameter| moves[parameter.index()]));
                }
            }
            lines.end_ray(pixel);
        }
        tangents.falls = builder.flow.falls(fallen);
        Ok((lines, tangents))
    }
}

/// What the nodes of a ray share.
struct Builder<'a> {
    model: &'a WorldModel,
    flow: Flowing<'a>,
    numbers: [Number; PARAMETERS],
    /// α and β.
    ray: [Number; 2],
    /// Jy in the pixel of 1 M of emission 1 on the ray.
    jy: f64,
}

impl Builder<'_> {
    fn push(&self, node: &DifferentiatedNode, lines: &mut Sightlines) {
        lines.push(node.value.position, self.jy * node.value.weight);
        if self.model.slow_light {
            lines.delay.push(node.value.delay - self.flight());
        }
        if self.model.redshift.is_some() {
            let columns = lines.momentum.iter_mut().zip(node.value.momentum);
            columns.for_each(|(column, x)| column.push(x));
            lines.radial.push(node.value.radial);
        }
    }

    /// What the time of flight from a finite radius has in excess of its finite part.
    fn flight(&self) -> f64 {
        self.model.observer_radius.map_or(0.0, |radius| radius + 2.0 * radius.ln())
    }

    /// A number of a node, by way of spin, inclination, α and β, with respect to all parameters.
    fn number(&self, value: f64, gradient: Gradient) -> Number {
        let [alpha, beta] = self.ray;
        let mut slope = core::array::from_fn(|k| {
            gradient.alpha * alpha.slope[k] + gradient.beta * beta.slope[k]
        });
        slope[Parameter::Spin.index()] += gradient.spin;
        slope[Parameter::Inclination.index()] += gradient.inclination;
        Number { value, slope }
    }

    fn moves(&self, node: &DifferentiatedNode) -> ([Move; PARAMETERS], Option<Fallen>) {
        let (at, by) = (&node.value, &node.gradient);
        let vector = |at: [f64; 3], by: [Gradient; 3]| [0, 1, 2].map(|c| self.number(at[c], by[c]));
        let of = |parameter: Parameter| self.numbers[parameter.index()];
        let position = vector(at.position, by.position);
        let [x, y, z] = position;
        let r = (x * x + y * y + z * z).sqrt();
        let spin = of(Parameter::Spin);
        let falling = self.flow.at(r);
        let velocity = match falling {
            Some([_, turn]) => turn,
            None => {
                let along = Number::constant(self.model.axis.vector()[2]);
                self.model.law.rate(r, spin * along)
            }
        };
        let plain = self.number(at.weight, by.weight) * Number::constant(self.jy);
        let momentum = vector(at.momentum, by.momentum);
        let fall = falling.map(|[fall, _]| [fall, self.number(at.radial, by.radial)]);
        let gas = Gas { position, momentum, spin, velocity, fall };
        let weight = match self.model.redshift {
            Some(Redshift { power }) => self.shifted(&gas, plain, power),
            None => plain,
        };
        let delay = self.number(at.delay, by.delay);
        let moves = core::array::from_fn(|k| Move {
            position: [0, 1, 2].map(|c| position[c].slope[k]),
            weight: weight.slope[k],
            rate: -velocity.slope[k],
            time: if self.model.slow_light { -delay.slope[k] } else { 0.0 },
        });
        (moves, falling.map(|rates| self.flow.origin(r, rates)))
    }

    /// Weight times g^power: dark where the gas would be faster than light.
    fn shifted(&self, gas: &Gas<Number>, plain: Number, power: f64) -> Number {
        let Some(g) = gas.redshift(self.model.axis.vector()) else { return Number::constant(0.0) };
        let exponent = Number::constant(power) * g.ln();
        let value = exponent.value.exp();
        plain * Number { value, slope: exponent.slope.map(|slope| value * slope) }
    }
}
