//! The files of the page, in the program. It guarantees that the page loads nothing from anywhere else.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

const FILES: [(&str, &str, &str); 7] = [
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
    ("canvas.js", SCRIPT, include_str!("canvas.js")),
    ("graph.js", SCRIPT, include_str!("graph.js")),
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
