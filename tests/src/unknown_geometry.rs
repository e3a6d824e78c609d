//! Fits that do not know the geometry.

use crate::fit::killed_fit;
use crate::support::{
    fail_with, folder_with, json, new_folder, root, sets, succeed, told, words_of,
};

/// The built-in flare seen by the ngEHT, few pixels and scans, from another inclination and orientation than its
/// settings say.
fn settings(geometries: usize) -> String {
    let built_in = std::fs::read_to_string(root().join("cli/src/fit/built_in.toml")).unwrap();
    let small = built_in
        .replace("pixels = 40", "pixels = 20")
        .replace("jy_per_pixel = 0.08", "jy_per_pixel = 0.32")
        .replace("scans = 64", "scans = 12")
        .replace("steps = 600", "steps = 20")
        .replace("steps = 300", "steps = 20")
        .replace("nodes = 64", "nodes = 24");
    let view = format!(
        "{{ trials = {geometries}, nodes = 16, iterations = 25, pixels = 20, frames = 12 }}"
    );
    let all = ["{ isotropic = [0.0, 180.0] }", "{ uniform = [-180.0, 180.0] }"];
    of_unknown_view(&small, all, 2, &view)
}

/// Priors of inclination and position angle about those of the built-in flare.
pub const NEAR: [&str; 2] = ["{ uniform = [50.0, 70.0] }", "{ uniform = [-10.0, 10.0] }"];

/// The settings of the built-in flare with priors of inclination and position angle, and a search of so many starts whose
/// views are both this one.
pub fn of_unknown_view(
    text: &str,
    [inclination, angle]: [&str; 2],
    starts: usize,
    view: &str,
) -> String {
    let known = "inclination_deg = 60.0\n";
    let priors = format!("inclination_deg = {inclination}\nposition_angle_deg = {angle}\n");
    assert!(text.contains(known));
    let text = text.replace(known, &priors);
    let search = format!("starts = {starts}\ncoarse = {view}\nfine = {view}\n");
    format!("{text}\n[simulation.observer]\n{known}position_angle_deg = 0.0\n\n[search]\n{search}")
}

#[test]
#[ignore = "long"]
fn exact_inclination_and_position_angle_are_found_from_visibilities() {
    let folder = folder_with("fit.toml", settings(100));
    let said = told(folder.path(), &["fit", "fit.toml", "-o", "run"]);
    assert!(said.contains("inclination_deg = "), "{said}");
    let geometry = json(&folder.path().join("run/geometry.json"));
    let inclination = geometry["geometry"]["inclination_deg"].as_f64().unwrap();
    let angle = geometry["geometry"]["position_angle_deg"].as_f64().unwrap();
    assert!((inclination - 60.0).abs() < 3.0 && angle.abs() < 3.0, "{geometry}");
    let truth = geometry["truth"]["inclination_deg"].as_f64().unwrap();
    assert!((truth - 60.0).abs() < 1e-12);
    assert_eq!(geometry["starts"], 2);
}

/// Stations turn phases at random: geometries are compared by amplitudes and closure phases about the volume of each search
/// before. So few voxels do not explain the data, and the search does not claim what it has not found.
#[test]
#[ignore = "long"]
fn exact_a_search_without_phases_claims_no_more_than_it_has_found() {
    let folder = folder_with("fit.toml", settings(60));
    let settings = sets(&[
        "loss=[{data=\"amplitudes\",weight=1.0},{data=\"closure-phases\",weight=1.0}]",
        "simulation.observation.gains={constant_amplitude=0.0,scan_amplitude=0.0,random_phases=true}",
        "observer.inclination_deg={isotropic=[40.0,80.0]}",
        "observer.position_angle_deg={uniform=[-30.0,30.0]}",
        "search.starts=1",
        "representation=linear-grid",
        "linear.iterations=20",
        "linear.rounds=1",
    ]);
    let words = [&["fit", "fit.toml", "-o", "run"], &settings[..]].concat();
    succeed(folder.path(), &words);
    let geometry = json(&folder.path().join("run/geometry.json"));
    let left = geometry["chi2_per_datum"].as_f64().unwrap();
    for (name, truth) in [("inclination_deg", 60.0), ("position_angle_deg", 0.0)] {
        let found = geometry["geometry"][name].as_f64().unwrap();
        let sigma = geometry["sigma"][name].as_f64().unwrap_or(f64::INFINITY);
        println!("{name} = {found:.2} ± {sigma:.2}, χ²/N = {left:.1}");
        assert!(
            geometry["open"][name] == true || (found - truth).abs() < 3.0 * sigma,
            "{geometry}"
        );
        assert!((found - truth).abs() < 15.0, "{geometry}");
    }
}

/// A hot spot about a hole with spin 0.6, seen at 150 degrees.
const SCENE: &str = r#"
[hole]
spin = 0.6
mass_msun = 4.154e6
distance_kpc = 8.178
[observer]
inclination_deg = 150.0
azimuth_deg = 0.0
radius = inf
time = 0.0
[screen]
field_of_view_m = 20.0
width = 24
rings = "regular-grid"
total_flux_jy = 1.0
[effects]
redshift = true
spectral_index = 0.0
slow_light = true
[tracer]
integrator = "elliptic"
tolerance = 1e-6
[[volume]]
path = "made/truth.npz"
factor = 1.0
rotation = "keplerian"
reference_time = 0.0
"#;

/// Images of one ray in the middle of each pixel, as other programs make them: the narrow images near the critical curve
/// come and go from pixel to pixel, which is not in the way of the rest.
#[test]
#[ignore = "long"]
fn exact_geometry_of_a_movie_with_one_ray_a_pixel_is_found() {
    let path = &new_folder();
    let volume = sets(&[
        "simulation.truth.spot=[{center=[-5.0,3.0,0.0],sigma=1.0,amplitude=1.0}]",
        "output.nodes=96",
        "training.steps=1",
        "training.start=drawn",
        "training.occupancy=",
        "screen.pixels=16",
    ]);
    succeed(path, &[&["fit", "-o", "made"], &volume[..]].concat());
    std::fs::write(path.join("scene.toml"), SCENE).unwrap();
    let times = ["--frames", "12", "--from", "0", "--to", "60", "-o", "film"];
    succeed(path, &[&["movie", "scene.toml"][..], &times].concat());
    succeed(path, &["fit", "--init", "film", "-o", "fit.toml"]);
    let coarse = "{trials=120,nodes=14,iterations=30,pixels=24,frames=12}";
    let fine = "{trials=40,nodes=22,iterations=50,pixels=24,frames=12}";
    let search = format!("search={{starts=1,coarse={coarse},fine={fine}}}");
    let settings = sets(&[
        "hole.spin={uniform=[0.2,0.9]}",
        "observer.inclination_deg={isotropic=[130.0,170.0]}",
        "observer.position_angle_deg={uniform=[-20.0,20.0]}",
        "screen.width=20.0",
        "region.r_min=3.0",
        "region.r_max=9.0",
        "motion.velocity={keplerian={}}",
        "motion.axis=[0.0,0.0,1.0]",
        "data.movie.from=0.0",
        "data.movie.to=60.0",
        "loss.0.sigma=1e-4",
        "representation=linear-grid",
        "linear.iterations=40",
        "output.nodes=24",
        &search,
    ]);
    succeed(path, &[&["fit", "fit.toml", "-o", "run"], &settings[..]].concat());
    let geometry = json(&path.join("run/geometry.json"));
    for (name, truth, most) in
        [("spin", 0.6, 0.01), ("inclination_deg", 150.0, 0.3), ("position_angle_deg", 0.0, 0.3)]
    {
        let [found, sigma] = ["geometry", "sigma"].map(|of| geometry[of][name].as_f64().unwrap());
        println!("{name} = {found:.4} ± {sigma:.4}, {truth}");
        // Errors hold what finer voxels might move: far more than the values are off by.
        assert!((found - truth).abs() < f64::min(most, 4.0 * sigma), "{geometry}");
        assert!(sigma < 20.0 * most, "{geometry}");
    }
}

/// The search begins again, the fit goes on.
#[test]
#[ignore = "long"]
fn exact_same_bytes_after_kills_of_an_unknown_geometry() {
    let folder = folder_with("fit.toml", settings(12));
    let file = folder.path().join("fit.toml").display().to_string();
    killed_fit(&["fit".to_owned(), file], &["training.steps=400"], 8);
}

#[test]
fn exact_impossible_priors_are_refused_before_anything_is_written() {
    let folder = folder_with("fit.toml", settings(50));
    for (change, expected) in [
        (
            "observer.inclination_deg={uniform=[50.0,20.0]}",
            "last value of the prior = 20 is not allowed: above its first",
        ),
        ("hole.spin={uniform=[0.0,1.5]}", "hole.spin.uniform.1 = 1.5 is not allowed: -1 to 1"),
        ("hole.spin={uniform=[0.0,1.0]}", "hole.spin = 1 is not allowed: -0.999 to 0.999"),
        (
            "observer.position_angle_deg={isotropic=[0.0,1.0]}",
            "isotropic is a prior of inclinations",
        ),
        ("hole.spin={unifrom=[0.0,0.5]}", "hole.spin: unknown variant `unifrom`"),
        (
            "motion.velocity={infall={xi=0.5,beta_r={uniform=[0.5,1.5]},beta_phi=1.0}}",
            "motion.velocity.infall.beta_r.uniform.1 = 1.5 is not allowed: 0 to 1",
        ),
        ("search.starts=0", "search.starts = 0 is not allowed"),
        ("axis={from={start=[0.0,0.0,1.0],rate=0.1,last_rate=0.1}}", "[axis.known]"),
        ("hole.spin={uniform=[0.0,0.5]}", "simulation.hole.spin is missing: hole.spin has a prior"),
        ("observer.inclination_deg=60.0 observer.position_angle_deg=0.0", "there is none"),
        ("linear= representation.kind=grid training.start=drawn", "search: linear is missing"),
    ] {
        let settings = sets(&words_of(change));
        let words = [&["fit", "fit.toml", "-o", "run"], &settings[..]].concat();
        fail_with(folder.path(), &words, &[expected]);
    }
}
