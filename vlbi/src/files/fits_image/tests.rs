use super::super::fits::{Cards, padded};
use super::*;

/// Two rows of three pixels, the southern row first, of each plane, with more cards.
fn image(
    east_step: f64,
    planes: usize,
    first: bool,
    more: impl Fn(&mut Cards) -> &mut Cards,
) -> Vec<u8> {
    let mut cards = Cards::default();
    if first {
        cards.value("SIMPLE", "T");
    } else {
        cards.text("XTENSION", "IMAGE");
    }
    cards.value("BITPIX", -64).value("NAXIS", 3);
    cards.value("NAXIS1", 3).value("NAXIS2", 2).value("NAXIS3", planes).text("BUNIT", "JY/PIXEL");
    cards.number("CDELT1", east_step).number("CDELT2", 1e-9);
    more(&mut cards);
    let mut bytes = cards.finish();
    let values = [4.0, 5.0, 6.0, 1.0, 2.0, 3.0f64];
    let planes = (0..planes).flat_map(|k| values.map(|x| x + 10.0 * k as f64));
    bytes.extend(padded(planes.flat_map(f64::to_be_bytes).collect(), 0));
    bytes
}

fn file(east_step: f64) -> Vec<u8> {
    image(east_step, 1, true, |cards| cards)
}

/// Returns the message with which a file with these cards is refused.
fn refused(more: impl Fn(&mut Cards) -> &mut Cards) -> String {
    read(&image(-1e-9, 1, true, more)).expect_err("a card that is not read").to_string()
}

const PIXELS: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

#[test]
fn exact_north_comes_first_and_east_is_left() {
    let movie = read(&file(-1e-9)).unwrap();
    assert_eq!((movie.i.pixels, movie.polarized), (PIXELS.to_vec(), [None, None, None]));
    assert!((movie.i.grid.pixel_rad / 1e-9f64.to_radians() - 1.0).abs() < 1e-15);
    assert_eq!(read(&file(1e-9)).unwrap().i.pixels, [3.0, 2.0, 1.0, 6.0, 5.0, 4.0]);
    assert!(read(&file(-2e-9)).unwrap_err().to_string().contains("square"));
}

/// Cards as `eht-imaging` names them (its `save_im_fits`), and the same pixels and Stokes parameters read back.
#[test]
fn exact_written_images_have_the_cards_of_eht_imaging() {
    use crate::earth::SourcePosition;
    use crate::observation::{Basis, Measured, Observation, Row};
    let mut seen = Observation::empty(Basis::Stokes);
    (seen.source, seen.mjd) = ("M87".to_owned(), Some(57853));
    (seen.position, seen.frequency_hz) = (Some(SourcePosition::M87), Some(229.1e9));
    let datum = Measured { visibility: crate::Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
    seen.rows.push(Row::total_intensity(1.0, [0, 1], [0.0; 2], datum));
    let grid = ImageGrid::new(3, 2, 3e-10).unwrap();
    let [q, u] = [0.1, -0.2].map(|part| PIXELS.map(|x| part * x));
    let bytes = write(&[&PIXELS, &q, &u], grid, &seen);
    let movie = read(&bytes).unwrap();
    assert_eq!((movie.i.grid, &movie.i.pixels[..]), (grid, &PIXELS[..]));
    assert_eq!(movie.polarized, [Some(q.to_vec()), Some(u.to_vec()), None]);
    let text = String::from_utf8_lossy(&bytes);
    for card in ["OBJECT  = 'M87     '", "BUNIT   = 'JY/PIXEL'", "STOKES  = 'U       '"] {
        assert!(text.contains(card), "{card}");
    }
    let pixel = 3e-10f64.to_degrees() / 3.0;
    for (card, value) in [
        ("FREQ", 229.1e9),
        ("MJD", 57853.0),
        ("OBSRA", 187.70593),
        ("OBSDEC", 12.391123),
        ("CDELT1", -pixel),
        ("CDELT2", pixel),
    ] {
        let (_, rest) = text.split_once(&format!("{card:8}=")).expect(card);
        let number: f64 = rest.split_whitespace().next().unwrap().parse().expect(card);
        assert!((number / value - 1.0).abs() < 1e-7, "{card} = {number}");
    }
}

/// Cards that turn, shift or multiply the image, each refused by its name; the same with harmless values is read.
#[test]
fn exact_cards_that_are_not_read_are_refused() {
    for (keyword, wrong, harmless) in [
        ("CROTA1", 1.0, 0.0),
        ("CROTA2", 90.0, 0.0),
        ("PC1_1", 0.0, 1.0),
        ("PC1_2", -1.0, 0.0),
        ("PC2_1", 1e-3, 0.0),
        ("PC002001", 1.0, 0.0),
        ("CRPIX1", 4.5, 2.0),
        ("CRPIX2", -1.0, 2.0),
        ("LONPOLE", 90.0, 180.0),
        ("PV2_1", 0.1, 0.0),
        ("EQUINOX", 1950.0, 2000.0),
    ] {
        let message = refused(|cards| cards.number(keyword, wrong));
        assert!(message.contains(keyword), "{message}");
        let good = image(-1e-9, 1, true, |cards| cards.number(keyword, harmless));
        assert_eq!(read(&good).unwrap().i.pixels, PIXELS, "{keyword}");
    }
    let message = refused(|cards| cards.number("CD1_1", -1e-9));
    assert!(message.contains("CD1_1"), "{message}");
    for (keyword, wrong, right) in [
        ("CTYPE1", "GLON-SIN", "RA---SIN"),
        ("CTYPE1", "DEC--SIN", "RA---TAN"),
        ("CTYPE2", "DEC--CAR", "DEC--SIN"),
        ("CUNIT1", "arcsec", "deg"),
        ("STOKES", "XX", "I"),
    ] {
        let message = refused(|cards| cards.text(keyword, wrong));
        assert!(message.contains(keyword), "{message}");
        let good = image(-1e-9, 1, true, |cards| cards.text(keyword, right));
        assert!(read(&good).is_ok(), "{keyword}");
    }
    let planes = |kind: &'static str| image(-1e-9, 2, true, |cards| cards.text("CTYPE3", kind));
    for kind in ["FREQ", "TIME", ""] {
        assert!(read(&planes(kind)).unwrap_err().to_string().contains("NAXIS3"), "{kind}");
    }
}

/// Planes of an axis STOKES go where their numbers say; Q alone is never I.
#[test]
fn exact_planes_of_stokes_parameters() {
    let of = |planes: usize, first: f64, step: f64| {
        read(&image(-1e-9, planes, true, |cards| {
            cards.text("CTYPE3", "STOKES").number("CRVAL3", first).number("CDELT3", step);
            cards.number("CRPIX3", 1.0)
        }))
    };
    let plane = |k: usize| PIXELS.map(|x| x + 10.0 * k as f64).to_vec();
    let all = of(4, 1.0, 1.0).unwrap();
    assert_eq!(all.i.pixels, plane(0));
    assert_eq!(all.polarized, [1, 2, 3].map(|k| Some(plane(k))));
    let down = of(4, 4.0, -1.0).unwrap();
    assert_eq!((down.i.pixels, down.polarized[2].clone()), (plane(3), Some(plane(0))));
    let iv = of(2, 1.0, 3.0).unwrap();
    assert_eq!(iv.polarized, [None, None, Some(plane(1))]);
    for (planes, first, says) in
        [(1, 2.0, "no Stokes I"), (2, 1.0, "Q and U"), (1, -1.0, "CRVAL3"), (5, 1.0, "CRVAL3")]
    {
        let message = of(planes, first, 1.0).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}

/// Units named Q, U and V, as eht-imaging writes them.
#[test]
fn exact_units_of_stokes_parameters() {
    let with = |names: &[&str]| {
        let mut bytes = image(-1e-9, 1, true, |cards| cards.text("STOKES", "I"));
        for name in names {
            bytes.extend(image(-1e-9, 1, false, |cards| cards.text("EXTNAME", name)));
        }
        read(&bytes)
    };
    let pixels = Some(PIXELS.to_vec());
    let all = with(&["Q", "U", "V"]).unwrap();
    assert_eq!(all.polarized, [pixels.clone(), pixels.clone(), pixels.clone()]);
    assert_eq!(with(&["Q", "U"]).unwrap().polarized, [pixels.clone(), pixels, None]);
    for (names, says) in [
        (&["Q"][..], "Q and U"),
        (&["Q", "U", "Q"], "two images of Stokes Q"),
        (&["ERROR"], "EXTNAME = 'ERROR"),
    ] {
        let message = with(names).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn exact_damaged_files_are_errors() {
    let good = file(-1e-9);
    for end in 0..good.len() {
        assert!(read(&good[..end]).is_err(), "{end}");
    }
    let text = |from: &str, to: &str| {
        let at = good.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut bytes = good.clone();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        read(&bytes).unwrap_err().to_string()
    };
    assert!(text("JY/PIXEL", "JY/BEAM ").contains("JY/PIXEL"));
    assert!(
        text("NAXIS1  =                    3", "NAXIS1  = 99999999999999999999").contains("NAXIS1")
    );
    let mut nan = good.clone();
    nan[2880..2888].copy_from_slice(&f64::NAN.to_be_bytes());
    assert!(read(&nan).unwrap_err().to_string().contains("byte 2880: a pixel is NaN"));
}
