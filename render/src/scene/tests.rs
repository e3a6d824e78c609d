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
    assert!(text.contains("300 to 1e8 (K)"), "{text}");
}

#[test]
fn values_out_of_range_name_line_key_and_range() {
    let text = error("spin = 0.9", "spin = 1.2");
    assert_eq!(text, "line 3: `hole.spin` = 1.2 is not allowed: -1 to 1 (a/M)");
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

/// The photon orbit against the spin is at 3.91 M for 0.9 (Bardeen, Press & Teukolsky 1972, equation 2.18).
#[test]
fn orbits_end_farther_out_against_the_spin() {
    let old = "radius = 10.0\nphase_deg = 45.0\naxis = [0.0, 1.0, 1.0]";
    let new = "radius = 3.5\nphase_deg = 45.0";
    assert!(Scene::parse(&SCENE.replacen(old, new, 1)).is_ok());
    let text = error(old, &format!("{new}\naxis = [0.0, 0.0, -2.0]"));
    let expected = "line 31: `spot.1.radius` = 3.5 is not allowed: a radius above 3.9103";
    assert!(text.starts_with(expected), "{text}");
}

#[test]
fn unknown_keys_and_wrong_types_name_the_line() {
    let text = error("spin = 0.9", "spinn = 0.9");
    assert!(text.contains("line 3") && text.contains("spinn") && text.contains("`spin`"), "{text}");
    let text = error("spin = 0.9", "spin = \"fast\"");
    assert!(text.contains("line 3") && text.contains("expected a number"), "{text}");
    let text = error("width = 64", "width = -3");
    assert!(text.contains("expected a whole number, 0 to 4294967295"), "{text}");
    let text = error("opaque = true", "opaque = true\n[sky.chequers]\nx = 1");
    assert!(text.contains("chequers") && text.contains("checker"), "{text}");
    let text = error("[hole]", "[hole");
    assert!(text.contains("line 2"), "{text}");
}

#[test]
fn too_many_pixels_are_refused() {
    assert!(error("width = 64", "width = 1000000000").contains("1 to 16384"));
}

#[test]
fn redshift_needs_a_spectral_index() {
    let text = error("[tracer]", "[effects]\nredshift = true\n\n[tracer]");
    assert!(text.contains("effects.spectral_index") && text.contains("missing"), "{text}");
}

#[test]
fn overrides_change_the_text() {
    let deep = format!("{}=1", vec!["a"; 50_000].join("."));
    let error = apply_override(SCENE, &deep).unwrap_err().to_string();
    assert!(error.contains("50000 keys: at most 32"), "{}", error.len());
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
    assert!(error("spot.7.sigma=1").contains("`spot` needs a number from 0 to 2"));
    assert!(error("spot.sigma=1").contains("`spot` needs a number from 0 to 2"));
    assert!(error("spot.2=").contains("no such one to remove"));
    assert!(error("spot.1=3").contains("names a table of `spot`"));
    assert!(error("mesh.1.path=a.obj").contains("there is no `mesh`, so none with number 1"));
    assert!(error("hole.spin.x=1").contains("not a table"));
    assert!(error("hole=1").contains("names a table"));
    let chosen = apply_override("[a.start.linear]\nnodes = 3\n\n[b]\nc = 1\n", "a.start=drawn");
    assert_eq!(
        chosen.unwrap().parse::<toml::Table>().unwrap()["a"]["start"].as_str(),
        Some("drawn")
    );
    assert!(error(".=1").contains("empty key"));
}

/// The element after the last one of a list of tables adds one, as a whole or number by number.
#[test]
fn overrides_add_to_lists() {
    let text = "[[loss]]\nsigma = 1\n";
    let text = apply_override(text, "loss.1.sigma=2").unwrap();
    let text = apply_override(&text, "loss.1.weight=3").unwrap();
    let text = apply_override(&text, "loss.2={sigma=4, at={x=1}}").unwrap();
    let text = apply_override(&text, "loss.2.at.x=5").unwrap();
    let text = apply_override(&text, "regulariser.0.kind=entropy").unwrap();
    let text = apply_override(&text, "inline=[{a=1},{a=2}]").unwrap();
    let text = apply_override(&text, "inline.1.a=3").unwrap();
    let text = apply_override(&text, "loss.0=").unwrap();
    let wanted = "inline = [{ a = 1 }, { a = 3 }]\n[[loss]]\nsigma = 2\nweight = 3\n\
                  [[loss]]\nsigma = 4\nat = { x = 5 }\n[[regulariser]]\nkind = \"entropy\"\n";
    let found: toml::Table = text.parse().unwrap();
    assert_eq!(found, wanted.parse::<toml::Table>().unwrap(), "{text}");
}

#[test]
fn exact_a_screen_is_square_without_a_height() {
    let square = SCENE.replacen("height = 64\n", "", 1);
    assert_eq!(Scene::parse(&square).unwrap().screen.rows(), 64);
    let smaller = apply_override(&square, "screen.width=32").unwrap();
    let scene = Scene::parse(&smaller).unwrap();
    assert_eq!(scene.screen.rows(), 32);
    assert!(scene.to_toml().contains("height = 32"), "{}", scene.to_toml());
    assert!(error("height = 64", "height = 0").contains("`screen.height` = 0"));
}

/// Scenes in M need neither mass nor distance; others are refused with what to write.
#[test]
fn exact_mass_and_distance_are_needed_where_they_matter() {
    let bare = SCENE.replacen("mass_msun = 4.154e6\ndistance_kpc = 8.178\n", "", 1);
    let scene = Scene::parse(&bare).unwrap();
    assert_eq!((scene.hole.seconds(), scene.hole.angle_uas()), (None, None));
    assert_eq!(Scene::parse(&scene.to_toml()).unwrap().hole, scene.hole);
    for more in ["total_flux_jy = 2.0\nwidth", "width"] {
        let field =
            if more == "width" { "field_of_view_uas = 90.0" } else { "field_of_view_m = 20.0" };
        let text = bare.replacen("width", more, 1).replacen("field_of_view_m = 20.0", field, 1);
        let text = Scene::parse(&text).unwrap_err().to_string();
        assert!(text.contains("`hole.mass_msun` is missing") && text.contains("4.154e6"), "{text}");
    }
    assert!(error("mass_msun = 4.154e6", "mass_msun = 0").contains("`hole.mass_msun` = 0"));
}

/// The scene with a volume that turns by `law`, or what is wrong with it.
fn volume(key: &str, law: &str) -> Result<Scene, String> {
    let head = "[[volume]]\npath = \"v.npz\"\nfactor = 1.0\nreference_time = 0.0\n";
    let text = SCENE.replacen("[[spot]]", &format!("{head}{key} = {law}\n\n[[spot]]"), 1);
    Scene::parse(&text).map_err(|error| error.to_string())
}

fn volume_with_region(key: &str, law: &str) -> Result<Scene, String> {
    volume(key, &format!("{law}\nregion = {{ r_min = 2.0, r_max = 9.0 }}"))
}

/// A law that varies at random about a Keplerian one.
fn perturbed(end: &str) -> String {
    let of = "of = { keplerian = { drag = 0.5 } }, correlation_length = 0.5, radii = [2.0, 9.0]";
    format!("{{ perturbed = {{ {of}, {end} }} }}")
}

/// The laws of fits under the names of fits.
#[test]
fn exact_volumes_turn_as_fits_let_them() {
    let hole = Kerr::new(0.9).unwrap();
    let rate = |law: &str, r: f64| {
        let scene = volume("rotation", law).unwrap();
        let again = Scene::parse(&scene.to_toml()).unwrap();
        assert_eq!(again.volume, scene.volume, "{law}");
        assert_eq!(volume("velocity", law).unwrap().volume, scene.volume);
        let axis = crate::dynamics::Axis::new([0.0, 0.0, 1.0]).unwrap();
        scene.volume[0].rotation.about(&hole, axis).unwrap().map_or(0.0, |law| law.rate(r))
    };
    assert_eq!(rate("\"none\"", 4.0), 0.0);
    assert_eq!(rate("\"keplerian\"", 4.0), 1.0 / 8.9);
    assert_eq!(rate("{ keplerian = { drag = 0.5 } }", 4.0), 1.0 / 8.5);
    assert_eq!(rate("{ keplerian = {} }", 4.0), 1.0 / 8.9);
    assert_eq!(rate("{ power-law = { radius = 8.0, rate = 0.25, exponent = 2.0 } }", 4.0), 1.0);
    assert_eq!(rate("{ table = { radii = [2.0, 6.0], rates = [0.5, 0.25] } }", 4.0), 0.375);
    let falls =
        volume_with_region("rotation", "{ infall = { xi = 0.7, beta_r = 0.9, beta_phi = 0.8 } }");
    let axis = crate::dynamics::Axis::new([0.0, 0.0, -1.0]).unwrap();
    let flow = falls.unwrap().volume[0].rotation.about(&hole, axis).unwrap().unwrap();
    let law = Velocity::Infall { xi: 0.7, beta_r: 0.9, beta_phi: 0.8, drag: Some(-0.9) };
    assert_eq!(flow, law.angular(0, 0.0).unwrap());
    assert!(flow.fall(8.0) < 0.0 && flow.rate(8.0) > 0.0);
    let still = rate(&perturbed("deviation = 0.0, seed = 3"), 2.0);
    assert!((still - rate("{ keplerian = { drag = 0.5 } }", 2.0)).abs() < 1e-15);
    let drawn = |seed: u32| rate(&perturbed(&format!("deviation = 0.1, seed = {seed}")), 4.0);
    assert_eq!(drawn(3), drawn(3));
    assert_ne!(drawn(3), drawn(4));
}

/// Bad numbers of a law are named.
#[test]
fn bad_laws_of_volumes_are_named() {
    for (law, says) in [
        ("\"rigid\"", "expected `none` or `keplerian`"),
        ("{ table = { radii = [2.0], rates = [] } }", "`volume.0.rotation.table.rates` = 0"),
        ("{ keplerian = { drag = 1e9 } }", "`volume.0.rotation.keplerian.drag` = 1e9"),
        (&perturbed("deviation = -1.0, seed = 3"), "rotation.perturbed.deviation` = -1"),
        (&perturbed("deviation = 1.0"), "missing field `seed`"),
        ("{ infall = { xi = 0.7, beta_r = 1.0, beta_phi = 1.0 } }", "`volume.0.region` is missing"),
    ] {
        let text = volume("rotation", law).unwrap_err();
        assert!(text.contains(says), "{law}: {text}");
    }
    for (law, says) in [
        ("{ infall = { xi = 1.7, beta_r = 1.0, beta_phi = 1.0 } }", "rotation.infall.xi` = 1.7"),
        ("{ infall = { xi = 0.7, beta_r = 1.0 } }", "missing field `beta_phi`"),
        ("{ infall = { xi = 0.7, beta_r = 1.0, beta_phi = 1.0, drag = 3 } }", "infall.drag` = 3"),
        (
            "{ profile = { radii = [3.0, 4.0], angular = [0.1, 0.1], radial = [-0.1, 0.1] } }",
            "rotation.profile.radial` = 0.1",
        ),
    ] {
        let text = volume_with_region("rotation", law).unwrap_err();
        assert!(text.contains(says), "{law}: {text}");
    }
}

#[test]
fn exact_a_power_of_the_redshift_is_a_spectral_index_and_2() {
    let with = |effects: &str| {
        let effects = format!("[effects]\n{effects}\n\n[tracer]");
        Scene::parse(&SCENE.replacen("[tracer]", &effects, 1)).map_err(|error| error.to_string())
    };
    let index = |effects: &str| with(effects).unwrap().effects.index();
    assert_eq!(index("redshift = true\nredshift_power = 3.0"), Some(1.0));
    assert_eq!(index("redshift = true\nspectral_index = 1.0"), Some(1.0));
    assert_eq!(index("spectral_index = 1.0"), None);
    assert!(with("redshift_power = 2.0").unwrap_err().contains("only with redshift = true"));
    let both = with("redshift = true\nredshift_power = 2.0\nspectral_index = 0.0").unwrap_err();
    assert!(both.contains("not both"), "{both}");
}
