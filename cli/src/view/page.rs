//! The files of the page.

use super::given;
use super::matter::Volumes;
use super::subject::Subject;
use crate::report::{escape, fill};
use kerrlight_geodesic::wgsl;

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");
const SHADERS: [&str; 3] = [
    include_str!("assets/view.wgsl"),
    include_str!("assets/look.wgsl"),
    include_str!("assets/follow.wgsl"),
];
const ENLARGE: &str = include_str!("assets/enlarge.wgsl");
const SCRIPTS: [&str; 6] = [
    include_str!("assets/kerr.js"),
    include_str!("assets/state.js"),
    include_str!("assets/gpu.js"),
    include_str!("assets/ray.js"),
    include_str!("assets/exr.js"),
    include_str!("assets/main.js"),
];

/// The name of the page, and of what it loads.
const INDEX: &str = "index.html";
const VOLUMES: &str = "volumes.js";

/// A page: one file, and one with its volumes if it has any.
pub struct Page {
    index: String,
    volumes: Option<String>,
}

impl Page {
    /// The page of a subject.
    pub fn of(subject: &Subject) -> anyhow::Result<Self> {
        let volumes = Volumes::of(subject)?;
        let given = given::of(subject, &volumes)?;
        let stored = stored(subject, &volumes);
        let script = format!("<script src=\"{VOLUMES}\"></script>\n");
        let shaders = SHADERS.join("\n");
        let parts = [
            ("title", escape(&format!("{}: kerrlight", subject.title))),
            ("style", STYLE.to_owned()),
            ("shader", format!("{}\n{shaders}", wgsl::library())),
            ("enlarge", ENLARGE.to_owned()),
            // Within a script nothing may look like its end.
            ("given", given.to_string().replace('<', "\\u003c")),
            ("volumes", if stored.is_some() { script } else { String::new() }),
            ("scripts", SCRIPTS.join("\n")),
        ];
        Ok(Page { index: fill(PAGE, &parts), volumes: stored })
    }

    /// Names and contents, the page first.
    pub fn files(&self) -> Vec<(&'static str, &str)> {
        let volumes = self.volumes.as_deref().map(|content| (VOLUMES, content));
        [(INDEX, self.index.as_str())].into_iter().chain(volumes).collect()
    }
}

/// A script with volumes and pictures of the data.
fn stored(subject: &Subject, volumes: &Volumes) -> Option<String> {
    let line =
        |name: &str, bytes: &[u8]| format!("VOLUMES.{name} = \"{}\";\n", base64::encode(bytes));
    let textures = volumes.textures.iter().map(|texture| line(texture.name, &texture.bytes()));
    let data = subject.measured.as_ref().map(|measured| {
        let brightest = given::brightest(measured);
        let byte = |value: &f32| (value / brightest * 255.0).round().clamp(0.0, 255.0) as u8;
        line("data", &measured.pixels.iter().map(byte).collect::<Vec<_>>())
    });
    let all: String = textures.chain(data).collect();
    (!all.is_empty()).then_some(all)
}
