//! The scan of the whole sphere of axes as a table, a picture and a line of the log.

use kerrlight_render::image::colormap::Colormap;
use kerrlight_tomo::fit::scan::{AxisLoss, AxisScan};
use kerrlight_tomo::recovery::FoundAxis;
use serde_json::{Value, json};
use std::io::Cursor;

/// The map of losses as a table.
pub fn table(scan: &AxisScan) -> String {
    let line = |at: &AxisLoss| {
        let [x, y, z] = at.axis.vector();
        format!("{x},{y},{z},{}\n", at.loss)
    };
    let rows: String = scan.map.iter().map(line).collect();
    format!("x,y,z,loss\n{rows}")
}

/// The map as a PNG.
pub fn picture(scan: &AxisScan) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    scan.picture(720, Colormap::Viridis)?.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// A line of the log.
pub fn line(found: &FoundAxis) -> Value {
    let FoundAxis { scan, refined } = found;
    let refined = refined.map(|at| json!({"best": at.axis.vector(), "loss": at.loss}));
    json!({
        "step": 0,
        "axis_scan": {
            "best": scan.best.axis.vector(), "loss": scan.best.loss,
            "runner_up": scan.runner_up.axis.vector(), "runner_up_loss": scan.runner_up.loss,
            "refined": refined,
        },
    })
}
