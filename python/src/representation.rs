//! Representations that are written in Python, by the name of their class: `representation.kind = "module:Class"`.
//!
//! `kerrlight.representation` loads the class and checks what its methods give; here is the trait for it.

use crate::pictures::json_of_toml;
use kerrlight_tomo::representation::{
    BuildError, Coordinates, Gradient, OwnSettings, Representation, Workspace,
};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use std::panic::resume_unwind;

/// An exception that a method of the class raised. The trait has no errors: it unwinds, and the program catches
/// it.
#[derive(thiserror::Error, Debug)]
#[error("the representation raised {}", said(.0))]
pub struct Raised(pub PyErr);

/// An instance of a class.
struct OfPython {
    instance: Py<PyAny>,
    dimension: usize,
    parameters: usize,
}

/// The representation of a name with a colon; of none without one.
pub fn find(
    name: &str,
    own: &OwnSettings,
) -> Option<Result<Box<dyn Representation<f32>>, BuildError>> {
    name.contains(':').then(|| {
        let loaded = Python::attach(|py| load(py, name, own));
        let loaded =
            loaded.map_err(|error| format!("representation.kind = {name:?}: {}", said(&error)))?;
        Ok(Box::new(loaded) as Box<dyn Representation<f32>>)
    })
}

fn load(py: Python<'_>, name: &str, own: &OwnSettings) -> PyResult<OfPython> {
    let settings = json_of_toml(&own.table)?;
    let region = (own.r_min, own.r_max, own.z_width);
    let module = py.import("kerrlight.representation")?;
    let instance = module.call_method1("_load", (name, region, settings))?;
    let [dimension, parameters] = ["dimension", "parameters"].map(|key| instance.getattr(key));
    Ok(OfPython {
        dimension: dimension?.extract()?,
        parameters: parameters?.extract()?,
        instance: instance.unbind(),
    })
}

/// The words of an exception.
fn said(error: &PyErr) -> String {
    Python::attach(|py| {
        let kind = error.get_type(py).name().map_or("error".to_owned(), |name| name.to_string());
        format!("{kind}: {}", error.value(py))
    })
}

impl OfPython {
    /// Calls a method; what it raises unwinds.
    fn call<T>(&self, work: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> T {
        let done = Python::attach(|py| work(self.instance.bind(py)));
        done.unwrap_or_else(|error| resume_unwind(Box::new(Raised(error))))
    }
}

/// Points as an array over (point, coordinate).
fn points<'py>(py: Python<'py>, at: &Coordinates<'_, f32>) -> PyResult<Bound<'py, PyAny>> {
    let columns = at.columns();
    let count = columns.first().map_or(0, |column| column.len());
    let rows: Vec<f32> =
        (0..count).flat_map(|k| columns.iter().map(move |column| column[k])).collect();
    Ok(rows.into_pyarray(py).reshape([count, columns.len()])?.into_any())
}

fn array<'py>(py: Python<'py>, values: &[f32]) -> Bound<'py, PyArray1<f32>> {
    values.to_vec().into_pyarray(py)
}

/// Copies a result whose length has been checked.
fn copied(result: &Bound<'_, PyAny>, into: &mut [f32]) -> PyResult<()> {
    let result: PyReadonlyArray1<'_, f32> = result.extract()?;
    into.copy_from_slice(result.as_slice()?);
    Ok(())
}

impl Representation<f32> for OfPython {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn parameters(&self) -> usize {
        self.parameters
    }

    fn initialise(&self, seed: u64, parameters: &mut [f32]) {
        self.call(|own| copied(&own.call_method1("initialise", (seed,))?, parameters));
    }

    fn project(&self, parameters: &mut [f32]) {
        self.call(|own| {
            let found = own.call_method1("project", (array(own.py(), parameters),))?;
            if found.is_none() { Ok(()) } else { copied(&found, parameters) }
        });
    }

    fn eval(
        &self,
        parameters: &[f32],
        at: Coordinates<'_, f32>,
        values: &mut [f32],
        _: &mut Workspace,
    ) {
        self.call(|own| {
            let (py, at) = (own.py(), points(own.py(), &at)?);
            copied(&own.call_method1("eval", (array(py, parameters), at))?, values)
        });
    }

    fn vjp(
        &self,
        parameters: &[f32],
        at: Coordinates<'_, f32>,
        cotangents: &[f32],
        gradient: Gradient<'_, f32>,
        _: &mut Workspace,
    ) {
        let mut of_parameters = vec![0.0; parameters.len()];
        let mut of_points = vec![0.0; cotangents.len() * self.dimension];
        let wants_points = gradient.coordinates.is_some();
        self.call(|own| {
            let (py, at) = (own.py(), points(own.py(), &at)?);
            let arguments = (array(py, parameters), at, array(py, cotangents), wants_points);
            let (first, second): (Bound<'_, PyAny>, Bound<'_, PyAny>) =
                own.call_method1("vjp", arguments)?.extract()?;
            copied(&first, &mut of_parameters)?;
            if wants_points { copied(&second, &mut of_points) } else { Ok(()) }
        });
        // The trait adds to what is there; the class gives the part of this batch.
        gradient.parameters.iter_mut().zip(&of_parameters).for_each(|(sum, part)| *sum += *part);
        let Some(mut coordinates) = gradient.coordinates else { return };
        for (c, column) in coordinates.columns().iter_mut().enumerate() {
            let parts = of_points.iter().skip(c).step_by(self.dimension);
            column.iter_mut().zip(parts).for_each(|(sum, part)| *sum += *part);
        }
    }
}
