//! The picture is drawn of a small made-up run: it has to be an SVG that says what it shows.

use super::*;
use crate::metrics::{measure, object_spaces};
use crate::world::{Body, Collisions};
use agents::social_mapping::SocialConfig;
use nalgebra::{Isometry2, Point2, Vector2};
use resvg::usvg::{Options, Tree};

const HALL: &str = r#"
name = "hall <&> study"
start = "2026-03-02T10:00:00"
duration = 60.0
[[room]]
name = "hall"
polygon = [[0, 0], [9, 0], [9, 6], [0, 6]]
[[room]]
name = "study"
polygon = [[9, 0], [12, 0], [12, 6], [9, 6]]
[[door]]
rooms = ["hall", "study"]
position = [9.0, 3.0]
width = 1.2
[[object]]
name = "screen"
class = "tv"
pose = [5.0, 5.9, -1.5708]
size = [0.1, 1.0]
[[object]]
name = "fern"
class = "plant"
shape = "circle"
pose = [11.0, 1.0, 0.0]
size = [0.6, 0.6]
[robot]
pose = [1.0, 3.0, 0.0]
[[activity]]
name = "news"
object = "screen"
start = "10:00"
end = "11:30"
[[mission]]
name = "visit"
goal = "visit.aggt"
"#;

fn hall() -> Scenario {
    Scenario::parse("scenario.toml", HALL, &|_| Ok(Vec::new())).expect("is sound")
}

/// From west to east in half a minute at `y`, into something at 15 s, past `people` who walk north.
fn run(scenario: &Scenario, y: f64, people: usize) -> Vec<Truth> {
    (0..=300)
        .map(|i| {
            let t = f64::from(i) * 0.1;
            let walker = |k: usize| Body {
                name: format!("walker_{k}"),
                position: Point2::new(2.0 + 6.0 * k as f64 / people as f64, 0.5 + 0.15 * t),
                heading: std::f64::consts::FRAC_PI_2,
                velocity: Vector2::new(0.0, 0.15),
                radius: 0.2,
            };
            Truth {
                time: scenario.start + t,
                world_from_robot: Isometry2::new(Vector2::new(1.0 + t / 3.0, y), 0.0),
                velocity: Vector2::new(1.0 / 3.0, 0.0),
                lateral: 0.0,
                people: (0..people).map(walker).collect(),
                collisions: Collisions {
                    walls: u64::from(i >= 150),
                    ..Collisions::default()
                },
            }
        })
        .collect()
}

fn draw(
    scenario: &Scenario,
    samples: &[Truth],
    baseline: Option<&[Truth]>,
    at: Option<f64>,
) -> String {
    let spaces = object_spaces(scenario, &SocialConfig::default()).expect("makes a map");
    let figures = |samples: &[Truth]| measure(samples, scenario.robot.radius, &spaces);
    let metrics = figures(samples);
    let plain = baseline.map(figures);
    let picture = Picture {
        scenario,
        spaces: &spaces,
        seed: 7,
        run: Run {
            social: true,
            success: true,
            samples,
            metrics: &metrics,
        },
        baseline: baseline.zip(plain.as_ref()).map(|(samples, metrics)| Run {
            social: false,
            success: false,
            samples,
            metrics,
        }),
        at: at.map(|seconds| scenario.start + seconds),
    };
    picture.svg()
}

/// Whether a text of the picture is just `words`.
fn says(svg: &str, words: &str) -> bool {
    svg.contains(&format!(">\n{words}\n</text>"))
}

fn size(svg: &str) -> [f32; 2] {
    let tree = Tree::from_str(svg, &Options::default()).expect("is an SVG");
    [tree.size().width(), tree.size().height()]
}

#[test]
fn the_picture_says_what_it_shows() {
    let scenario = hall();
    let samples = run(&scenario, 3.0, 3);
    let svg = draw(&scenario, &samples, Some(&run(&scenario, 2.0, 3)), None);
    for words in [
        "hall &lt;&amp;&gt; study, seed 7",
        "with social behaviour",
        "without social behaviour",
        "10 s",
        "20 s",
        "start",
        "end, 30 s",
        "hall",
        "study",
        "screen",
        "fern",
        "walker_1",
        "collision",
        "failed",
        "intimate zone",
        "2 m",
    ] {
        assert!(says(&svg, words), "{words}");
    }
    let closest = closest_encounter(&samples, scenario.robot.radius).unwrap();
    let elapsed = closest.time.since(scenario.start);
    assert!(svg.contains(&format!("At {elapsed:.1} s")));
    assert_eq!(
        svg.matches("#bd0026").count(),
        2 + 1,
        "a space in use is red, as in the legend"
    );
    assert_eq!(
        svg,
        draw(&scenario, &samples, Some(&run(&scenario, 2.0, 3)), None)
    );
}

#[test]
fn the_moment_can_be_chosen() {
    let scenario = hall();
    let svg = draw(&scenario, &run(&scenario, 3.0, 2), None, Some(12.34));
    assert!(says(&svg, "At 12.3 s") && !svg.contains("closest encounter"));
    assert!(!svg.contains("without"));
    let early = draw(&scenario, &run(&scenario, 3.0, 2), None, Some(-5.0));
    assert!(says(&early, "At 0.0 s"));
}

#[test]
fn a_run_without_samples_still_shows_the_map() {
    let scenario = hall();
    let svg = draw(&scenario, &[], None, None);
    assert!(says(&svg, "hall") && !says(&svg, "start"));
    size(&svg);
}

#[test]
fn a_crowd_stays_small_and_mostly_nameless() {
    let scenario = hall();
    let svg = draw(&scenario, &run(&scenario, 3.0, 150), None, None);
    assert_eq!(svg.matches("walker_").count(), 1);
    assert!(svg.len() < 500_000, "{}", svg.len());
}

#[test]
fn the_png_has_the_size_of_the_picture_and_words_in_it() {
    let scenario = hall();
    let svg = draw(&scenario, &run(&scenario, 3.0, 2), None, None);
    let [width, height] = size(&svg);
    let decode = |svg: &str| {
        let png = png(svg, 1.0).expect("can be drawn");
        resvg::tiny_skia::Pixmap::decode_png(&png).expect("is a PNG")
    };
    let pixels = decode(&svg);
    assert_eq!(
        [pixels.width(), pixels.height()],
        [width, height].map(|side| side.ceil() as u32)
    );
    // In the title's line there is ink only where the embedded font draws it.
    let ink = |pixels: &resvg::tiny_skia::Pixmap| {
        let title = pixels.pixels().iter().take(pixels.width() as usize * 45);
        title.filter(|pixel| pixel.red() < 128).count()
    };
    assert!(ink(&pixels) > 500, "{}", ink(&pixels));
    assert!(matches!(png("<html/>", 1.0), Err(PngError::Svg(_))));
    assert!(matches!(png(&svg, 1e9), Err(PngError::Size { .. })));
}
