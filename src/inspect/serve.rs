//! The server of the inspector's page. Guarantees of what comes from outside: a page of another site
//! cannot ask through the user's browser, and a change needs the token.

use super::api::{self, Question};
use super::desk::{Desk, Opener};
use super::edit::{self, Edit};
use super::{metrics, page};
use crate::Failure;
use axum::Router;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures_util::stream::{self, Stream};
use miette::{GraphicalReportHandler, GraphicalTheme};
use serde_json::{Value as Json, json};
use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;

/// How often the server looks whether it shall end.
const LOOK: Duration = Duration::from_millis(50);

/// Why there is no page.
#[derive(Debug, Error)]
pub(crate) enum ServeError {
    #[error("cannot listen on {address}: {source}")]
    Listen {
        address: SocketAddr,
        source: std::io::Error,
    },
    #[error("the server cannot run: {0}")]
    Run(std::io::Error),
}

/// What is served where.
pub(crate) struct Options {
    pub(crate) address: SocketAddr,
    /// Who has it may change the graph; `None` where nobody may.
    pub(crate) token: Option<String>,
}

#[derive(Clone)]
struct Served {
    desk: Desk,
    token: Option<Arc<str>>,
    /// Only this host connects.
    is_local: bool,
}

/// Serves until `ended`; tells the address that the page is at once it is there.
///
/// # Errors
/// [`Failure`] where the graph cannot be opened or the address not be had.
pub(crate) fn serve(
    options: &Options,
    opener: Opener,
    tell: impl FnOnce(SocketAddr),
    mut ended: impl FnMut() -> bool,
) -> Result<(), Failure> {
    let served = Served {
        desk: Desk::open(opener)?,
        token: options.token.as_deref().map(Arc::from),
        is_local: options.address.ip().is_loopback(),
    };
    let address = options.address;
    let listen = |source| Failure::input(ServeError::Listen { address, source });
    let listener = TcpListener::bind(address).map_err(listen)?;
    listener.set_nonblocking(true).map_err(listen)?;
    let bound = listener.local_addr().map_err(listen)?;
    let run = |error| Failure::internal(ServeError::Run(error));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(run)?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::from_std(listener).map_err(run)?;
        let server = tokio::spawn(axum::serve(listener, router(served)).into_future());
        tell(bound);
        while !ended() {
            tokio::time::sleep(LOOK).await;
        }
        server.abort();
        Ok(())
    })
}

fn router(served: Served) -> Router {
    let checked = served.clone();
    Router::new()
        .route("/metrics", get(figures))
        .route("/api/events", get(events))
        .route("/api/edit", post(change))
        .route("/api/{what}", get(question))
        .route("/", get(|| async { page::file("index.html") }))
        .route(
            "/{file}",
            get(|Path(file): Path<String>| async move { page::file(&file) }),
        )
        .layer(middleware::from_fn_with_state(checked, check_host))
        .with_state(served)
}

/// Refuses a request that a browser was led to by another site's name.
async fn check_host(State(served): State<Served>, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST);
    let host = host.and_then(|host| host.to_str().ok()).unwrap_or_default();
    if served.is_local && !is_this_host(host) {
        let said = "this page is for this host: open it by its address or as localhost\n";
        return (StatusCode::FORBIDDEN, said).into_response();
    }
    next.run(request).await
}

/// Whether a host header names this host by an address or as `localhost`.
fn is_this_host(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.chars().all(|c| c.is_ascii_digit()) => name,
        _ => host,
    };
    let name = name.trim_start_matches('[').trim_end_matches(']');
    name == "localhost" || name.parse::<IpAddr>().is_ok()
}

fn said(status: StatusCode, json: &Json) -> Response {
    let kind = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (status, kind, json.to_string()).into_response()
}

fn failed(failure: Failure) -> Response {
    let status = match failure {
        Failure::Input(_) => StatusCode::BAD_REQUEST,
        Failure::Internal(_) => StatusCode::INTERNAL_SERVER_ERROR,
    };
    let report = failure.into_report();
    let help = report.help().map(|help| help.to_string());
    let mut whole = String::new();
    // Writing to a string does not fail.
    let _ = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_links(false)
        .render_report(&mut whole, report.as_ref());
    said(
        status,
        &json!({"error": report.to_string(), "help": help, "report": whole.trim()}),
    )
}

fn gone() -> Response {
    said(
        StatusCode::SERVICE_UNAVAILABLE,
        &json!({"error": "the instance has ended"}),
    )
}

async fn question(
    State(served): State<Served>,
    Path(what): Path<String>,
    Query(asked): Query<Question>,
) -> Response {
    let allow_edit = served.token.is_some();
    let answer = served.desk.ask(move |looker| {
        let mut answer = api::answer(looker, &what, &asked)?;
        if let (Ok(json), "about") = (&mut answer, what.as_str()) {
            json["allow_edit"] = json!(allow_edit);
        }
        Some(answer)
    });
    match answer.await {
        None => gone(),
        Some(None) => said(
            StatusCode::NOT_FOUND,
            &json!({"error": "nobody knows that"}),
        ),
        Some(Some(Ok(json))) => said(StatusCode::OK, &json),
        Some(Some(Err(failure))) => failed(failure),
    }
}

async fn figures(State(served): State<Served>) -> Response {
    match served.desk.ask(metrics::metrics).await {
        None => gone(),
        Some(Ok(text)) => {
            let kind = (header::CONTENT_TYPE, "text/plain; version=0.0.4");
            ([kind], text).into_response()
        }
        Some(Err(failure)) => failed(failure),
    }
}

async fn change(State(served): State<Served>, headers: HeaderMap, body: String) -> Response {
    let Some(token) = &served.token else {
        let error = "changes are off; start the inspector with --allow-edit";
        return said(StatusCode::FORBIDDEN, &json!({"error": error}));
    };
    let given = headers
        .get("x-cortex-token")
        .and_then(|given| given.to_str().ok());
    if given != Some(token) {
        let error = "the token is missing or wrong: open the address that was printed";
        return said(StatusCode::UNAUTHORIZED, &json!({"error": error}));
    }
    let asked: Edit = match serde_json::from_str(&body) {
        Ok(asked) => asked,
        Err(error) => {
            let error = format!("this is no change: {error}");
            return said(StatusCode::BAD_REQUEST, &json!({"error": error}));
        }
    };
    let done = served.desk.ask(move |looker| edit::edit(looker, &asked));
    match done.await {
        None => gone(),
        Some(Ok(json)) => said(StatusCode::OK, &json),
        Some(Err(failure)) => failed(failure),
    }
}

async fn events(
    State(served): State<Served>,
) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    let mut frames = served.desk.frames();
    // What others were told last is not news to who comes now.
    frames.mark_unchanged();
    let stream = stream::unfold(frames, |mut frames| async move {
        // The thread that sends them has ended.
        frames.changed().await.ok()?;
        let frame = Arc::clone(&frames.borrow_and_update());
        Some((Ok(Event::default().data(&*frame)), frames))
    });
    Sse::new(stream).keep_alive(KeepAlive::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_addresses_and_localhost_name_this_host() {
        for host in [
            "localhost:7710",
            "127.0.0.1:7710",
            "[::1]:7710",
            "localhost",
        ] {
            assert!(is_this_host(host), "{host}");
        }
        for host in [
            "evil.example",
            "evil.example:7710",
            "localhost.evil.example:80",
            "",
        ] {
            assert!(!is_this_host(host), "{host}");
        }
    }
}
