use super::*;

const SCENE: &str = r#"
[hole]
spin = 0.9
mass_msun = 4.154e6
distance_kpc = 8.178

[observer]
inclination_deg = 60

[screen]
field_of_view_m = 20.0
width = 64
height = 64

[tracer]
integrator = "taylor-mino"
tolerance = 1e-8

[disc]
outer_edge = 15.0
peak_intensity = 1.0
opaque = true

[[spot]]
radius = 8.0
phase_deg = 0.0
sigma = 0.5
peak_emissivity = 1.0

[[spot]]
radius = 10.0
phase_deg = 45.0
axis = [0.0, 1.0, 1.0]
sigma = 0.5
peak_emissivity = 1.0
"#;

fn error(find: &str, replace: &str) -> String {
    assert!(SCENE.contains(find));
    Scene::parse(&SCENE.replacen(find, replace, 1)).unwrap_err().to_string()
}

#[test]
fn exact_round_trip_through_the_resolved_scene() {
    let scene = Scene::parse(SCENE).unwrap();
    assert_eq!(scene.observer.radius, f64::INFINITY);
    let mut resolved = Scene::parse(&scene.to_toml()).unwrap();
    assert_eq!(
        resolved.disc.as_ref().unwrap().inner_edge.map(|r| (1e6 * r).round()),
        Some(2320883.0)
    );
    resolved.disc.as_mut().unwrap().inner_edge = None;
    assert_eq!(resolved, scene);
}

#[test]
fn wrong_volumes_and_temperatures_name_key_and_range() {
    let volume = |more: &str| {
        let head = "[[volume]]\npath = \"v.npz\"\nfactor = 1.0\n";
        let text = SCENE.replacen("[[spot]]", &format!("{head}{more}\n\n[[spot]]"), 1);
        Scene::parse(&text).map_err(|error| error.to_string())
    };
    assert!(volume("rotation = \"none\"").is_ok());
    let text = volume("rotation = \"keplerian\"").unwrap_err();
    assert!(text.contains("`volume.0.reference_time` is missing"), "{text}");
    let law = "rotation = { power-law = { radius = 0.0, rate = 1.0, exponent = 0.0 } }";
    let text = volume(&format!("{law}\nreference_time = 0.0")).unwrap_err();
    assert!(text.contains("`volume.0.rotation.power-law.radius` = 0"), "{text}");
    let text = volume("rotation = \"none\"\nlow = [0.0, 0.0, 0.0]").unwrap_err();
    assert!(text.contains("`volume.0.high` is missing"), "{text}");
    let corners = "low = [0.0, 0.0, 0.0]\nhigh = [1.0, 0.0, 1.0]";
    let text = volume(&format!("rotation = \"none\"\n{corners}")).unwrap_err();
    assert!(text.contains("above low"), "{text}");
    let text = error("opaque = true", "opaque = true\npeak_temperature_k = 10.0");
    assert!(text.contains("[300, 1e8]"), "{text}");
}

#[test]
fn values_out_of_range_name_line_key_and_range() {
    let text = error("spin = 0.9", "spin = 1.2");
    assert_eq!(text, "line 3: `hole.spin` = 1.2 is not allowed: a number in [-1, 1]");
    let text = error("width = 64", "width = 0");
    assert!(text.starts_with("line 12: `screen.width` = 0"), "{text}");
    let text = error("sigma = 0.5\n", "");
    assert!(text.contains("missing field"), "{text}");
}

#[test]
fn values_in_lists_of_tables_are_located() {
    let text = error("radius = 10.0", "radius = 1.0");
    assert!(text.starts_with("line 31: `spot.1.radius` = 1 "), "{text}");
}

#[test]
fn unknown_keys_and_wrong_types_name_the_line() {
    let text = error("spin = 0.9", "spinn = 0.9");
    assert!(text.contains("line 3") && text.contains("spinn") && text.contains("`spin`"), "{text}");
    let text = error("spin = 0.9", "spin = \"fast\"");
    assert!(text.contains("line 3") && text.contains("spin"), "{text}");
    let text = error("opaque = true", "opaque = true\n[sky.chequers]\nx = 1");
    assert!(text.contains("chequers") && text.contains("checker"), "{text}");
    let text = error("[hole]", "[hole");
    assert!(text.contains("line 2"), "{text}");
}

#[test]
fn too_many_pixels_are_refused() {
    assert!(error("width = 64", "width = 1000000000").contains("[1, 16384]"));
}

#[test]
fn redshift_needs_a_spectral_index() {
    let text = error("[tracer]", "[effects]\nredshift = true\n\n[tracer]");
    assert!(text.contains("effects.spectral_index") && text.contains("missing"), "{text}");
}

#[test]
fn overrides_change_the_text() {
    let text = apply_override(SCENE, "hole.spin = -0.5").unwrap();
    let text = apply_override(&text, "spot.1.phase_deg=90").unwrap();
    let text = apply_override(&text, "sky.checker.field_deg=15").unwrap();
    let text = apply_override(&text, "sky.checker.brightness=1").unwrap();
    let scene = Scene::parse(&text).unwrap();
    assert_eq!((scene.hole.spin, scene.spot[1].phase_deg), (-0.5, 90.0));
    assert!(matches!(scene.sky, Some(Sky::Checker(_))));
}

#[test]
fn empty_overrides_remove_a_key() {
    let text = apply_override(SCENE, "screen.field_of_view_m=").unwrap();
    assert!(Scene::parse(&text).unwrap_err().to_string().contains("is missing"));
    let text = apply_override(&text, "screen.field_of_view_uas=100").unwrap();
    assert!((Scene::parse(&text).unwrap().field_of_view_m() - 19.94).abs() < 0.01);
    assert!(apply_override(SCENE, "hole.colour=").is_err());
}

/// A table takes the place of another, and the next override finds its way into it.
#[test]
fn overrides_replace_tables() {
    let text = "[[loss]]\nsigma = 1\n[axis.known]\n[output]\nnodes = 64\nstart = { linear = { nodes = 8 } }\n";
    let text = apply_override(text, "axis={scan={directions=400,rate=1e-2}}").unwrap();
    let text = apply_override(&text, "axis.scan.directions=8").unwrap();
    let text = apply_override(&text, "output.start.linear.nodes=9").unwrap();
    let text = apply_override(&text, "probe={nodes=5}").unwrap();
    let text = apply_override(&text, "loss=[{sigma=2},{sigma=3}]").unwrap();
    let text = apply_override(&text, "loss.1.sigma=4").unwrap();
    let found: toml::Table = text.parse().unwrap();
    let wanted = "[axis.scan]\ndirections = 8\nrate = 1e-2\n[output]\nnodes = 64\n\
                  [output.start.linear]\nnodes = 9\n[probe]\nnodes = 5\n[[loss]]\nsigma = 2\n[[loss]]\nsigma = 4";
    assert_eq!(found, wanted.parse::<toml::Table>().unwrap(), "{text}");
}

#[test]
fn overrides_that_lead_nowhere_say_so() {
    let error = |assignment| apply_override(SCENE, assignment).unwrap_err().to_string();
    assert!(error("hole.spin").contains("key.path=value"));
    assert!(error("spot.7.sigma=1").contains("index below 2"));
    assert!(error("mesh.0.path=a.obj").contains("there is no `mesh`, so none with number 0"));
    assert!(error("hole.spin.x=1").contains("not a table"));
    assert!(error("hole=1").contains("names a table"));
    assert!(error(".=1").contains("empty key"));
}
