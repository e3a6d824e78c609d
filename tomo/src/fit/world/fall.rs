//! How falling matter is carried along, for numbers that carry derivatives.

use super::{Law, Number, Parameter, World, WorldModel};
use crate::Error;
use kerrlight_geodesic::Scalar;
use kerrlight_geodesic::infall::Mixture;
use kerrlight_render::dynamics::AngularVelocity;
use kerrlight_render::dynamics::infall::{Falling, Family, Flow, Trajectory};

/// dr/dt and Ω as functions of the radius.
pub(super) enum Rates<'a> {
    /// Of matter that stays at its radius.
    Circular,
    /// Of a flow that is the same in all worlds.
    Fixed(&'a Falling),
    /// Of the family.
    Family(Box<Flow<Number>>),
}

/// What of the flow the tangents of nodes take: rates, and the table of the fall.
pub(super) struct Flowing<'a> {
    pub rates: Rates<'a>,
    table: Option<Trajectory<Number>>,
    circular: f64,
}

impl<'a> Flowing<'a> {
    /// Of a world.
    pub fn new(model: &'a WorldModel, world: &World) -> Result<Self, Error> {
        let numbers = world.numbers();
        let of = |parameter: Parameter| numbers[parameter.index()];
        match &model.law {
            Law::Fixed(AngularVelocity::Falling(flow)) => Ok(Self {
                table: Some(flow.lifted()),
                circular: flow.circular_from(),
                rates: Rates::Fixed(flow),
            }),
            Law::Infall(drag) => {
                let along = Number::constant(model.axis.vector()[2]);
                let [xi, beta_r, beta_phi] =
                    [Parameter::Xi, Parameter::BetaR, Parameter::BetaPhi].map(of);
                let spin = drag.map_or(of(Parameter::Spin) * along, Number::constant);
                let mixture = Mixture { xi, beta_r, beta_phi };
                let family = Family { spin, mixture };
                Ok(Self {
                    table: Some(family.trajectory()?),
                    circular: family.circular_from()?,
                    rates: Rates::Family(Box::new(family.flowing()?)),
                })
            }
            _ => Ok(Self { rates: Rates::Circular, table: None, circular: 0.0 }),
        }
    }

    /// dr/dt and Ω at a radius of matter that falls.
    pub fn at(&self, r: Number) -> Option<[Number; 2]> {
        match &self.rates {
            Rates::Circular => None,
            Rates::Fixed(flow) => Some(flow.slopes(r.value).map(|rate| Number {
                value: rate.value,
                slope: r.slope.map(|slope| slope * rate.slope[0]),
            })),
            Rates::Family(flow) => Some(flow.rates(r)),
        }
    }

    /// A node at a radius with these dr/dt and Ω, on its fall.
    pub fn origin(&self, radius: Number, [fall, turn]: [Number; 2]) -> Fallen {
        let inside = (radius.value < self.circular).then_some(self.table.as_ref()).flatten();
        let on_table = inside.and_then(|table| {
            let time = table.time_at(radius.value)?;
            let [reached, _] = table.at(Number::constant(time));
            let speed = table.speed(time);
            let slope = core::array::from_fn(|k| (radius.slope[k] - reached.slope[k]) / speed);
            let time = Number { value: time, slope };
            Some((time, table.at(time)[1]))
        });
        match on_table {
            Some((time, azimuth)) => Fallen { radius, time, azimuth, drift: None },
            None => {
                Fallen { radius, time: turn, azimuth: turn, drift: Some([fall, self.bend(radius)]) }
            }
        }
    }

    /// dΩ/dr, without its derivatives.
    fn bend(&self, r: Number) -> Number {
        let [near, far] = [-1e-5, 1e-5].map(|by| {
            let r = Number::constant(r.value * (1.0 + by));
            self.at(r).map_or(0.0, |[_, turn]| turn.value)
        });
        Number::constant((far - near) / (2e-5 * r.value))
    }

    /// What the tangents keep: the table and the nodes.
    pub fn falls(self, nodes: Vec<Fallen>) -> Option<Falls> {
        self.table.map(|table| Falls { table, nodes })
    }
}

/// A node on the fall of its matter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fallen {
    radius: Number,
    time: Number,
    azimuth: Number,
    /// Of matter that stays at its radius: dr/dt, which is 0 but for its derivatives, and dΩ/dr.
    drift: Option<[Number; 2]>,
}

/// All nodes, and the fall.
#[derive(Clone, Debug)]
pub(super) struct Falls {
    table: Trajectory<Number>,
    nodes: Vec<Fallen>,
}

impl Falls {
    /// What a node is stretched by and turned by to where its matter was `elapsed` before.
    pub fn before(&self, node: usize, elapsed: Number) -> [Number; 2] {
        let Fallen { radius, time, azimuth, drift } = self.nodes[node];
        let Some([fall, bend]) = drift else {
            let [before, turned] = self.table.at(time - elapsed);
            return [before / radius, turned - azimuth];
        };
        let half = Number::constant(0.5);
        let stretch = Number::constant(1.0) - fall * elapsed / radius;
        [stretch, elapsed * (half * bend * fall * elapsed - azimuth)]
    }
}
