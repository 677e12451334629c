//! The files of the page, in the program. It guarantees that the page loads nothing from anywhere else.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

const FILES: [(&str, &str, &str); 12] = [
    (
        "index.html",
        "text/html; charset=utf-8",
        include_str!("index.html"),
    ),
    (
        "style.css",
        "text/css; charset=utf-8",
        include_str!("style.css"),
    ),
    ("main.js", SCRIPT, include_str!("main.js")),
    ("agenda.js", SCRIPT, include_str!("agenda.js")),
    ("canvas.js", SCRIPT, include_str!("canvas.js")),
    ("details.js", SCRIPT, include_str!("details.js")),
    ("element.js", SCRIPT, include_str!("element.js")),
    ("forms.js", SCRIPT, include_str!("forms.js")),
    ("graph.js", SCRIPT, include_str!("graph.js")),
    ("log.js", SCRIPT, include_str!("log.js")),
    ("map.js", SCRIPT, include_str!("map.js")),
    ("mission.js", SCRIPT, include_str!("mission.js")),
];
const SCRIPT: &str = "text/javascript; charset=utf-8";
/// The browser holds the page to that too.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                      img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A file of the page.
pub(super) fn file(name: &str) -> Response {
    match FILES.iter().find(|(known, ..)| *known == name) {
        Some((_, kind, text)) => {
            let headers = [
                (header::CONTENT_TYPE, *kind),
                (header::CONTENT_SECURITY_POLICY, POLICY),
                (header::CACHE_CONTROL, "no-cache"),
            ];
            (headers, *text).into_response()
        }
        None => (StatusCode::NOT_FOUND, "there is no such page\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The luminance of a colour `#rrggbb`, as the guidelines of accessible content have it (WCAG 2.2).
    fn luminance(colour: &str) -> f64 {
        let part = |at: usize| {
            let share = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
            if share <= 0.04045 {
                share / 12.92
            } else {
                ((share + 0.055) / 1.055).powf(2.4)
            }
        };
        0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
    }

    fn contrast(one: &str, other: &str) -> f64 {
        let [one, other] = [one, other].map(|colour| luminance(colour) + 0.05);
        one.max(other) / one.min(other)
    }

    #[test]
    fn words_can_be_read_by_light_and_by_dark() {
        let (_, _, style) = FILES
            .iter()
            .find(|(name, ..)| *name == "style.css")
            .unwrap();
        let themes: Vec<&str> = style
            .lines()
            .filter(|line| line.contains(":root {"))
            .collect();
        assert_eq!(themes.len(), 2);
        for theme in themes {
            let colour = |name: &str| {
                let at = theme.find(&format!("--{name}: ")).unwrap() + name.len() + 4;
                &theme[at..at + 7]
            };
            for word in ["ink", "soft", "mark", "bad", "good"] {
                let contrast = contrast(colour(word), colour("paper"));
                assert!(contrast >= 4.5, "{word}: {contrast:.2}");
            }
            let chosen = contrast(colour("on-mark"), colour("mark"));
            assert!(chosen >= 4.5, "{chosen:.2}");
            // What borders a field need not be read.
            assert!(contrast(colour("edge"), colour("paper")) >= 3.0);
        }
    }

    #[test]
    fn nothing_is_loaded_from_elsewhere_and_every_import_is_there() {
        for (name, _, text) in FILES {
            assert!(
                !text.contains("http://") && !text.contains("https://"),
                "{name}"
            );
            for part in text.split("from './").skip(1) {
                let import = part.split('\'').next().unwrap();
                assert!(
                    FILES.iter().any(|(known, ..)| *known == import),
                    "{name}: {import}"
                );
            }
        }
    }
}
