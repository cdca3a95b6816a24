//! The page of a running test, on an address of this computer.
//!
//! ```text
//! Live ─▶ one teller: text, once for all ─▶ broadcast ─▶ a stream of events for each browser
//! ```
//!
//! A browser that does not keep up loses events, gets a notice, and fetches the state again: it holds up nobody. Everything that the page needs is in the
//! program; it loads nothing from elsewhere, and what comes from a log is put in as text.
//!
//! **Who may look.** On a loopback address everybody on the computer; on another address only with the token, once in the URL and then in a cookie
//! that scripts cannot read. A request under a foreign name (`Host`) is refused, so that a page of the internet cannot look through the browser of
//! somebody in the lab. **Who may end the recording**: only with the token, and only from the page itself (`Origin`).

mod connections;

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::{Query, Request, State as Shared};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use sagnac_log::setup::RateUnit;
use sagnac_log::threads::spawn;
use sagnac_log::{Error, Result};
use sagnac_report::{STYLE, UPLOT_CSS, UPLOT_JS, UPLOT_LICENCE};
use serde::{Deserialize, Serialize};
use tokio::sync::broadcast;
use tokio_stream::wrappers::BroadcastStream;
use tokio_stream::wrappers::errors::BroadcastStreamRecvError;
use tokio_stream::{Stream, StreamExt};

use self::connections::BoundedListener;
use crate::live::{Live, LiveState, Names, Now, Study, TrendPoint, Versions, Warning};
use crate::record::{SourceState, SourceStatus, Sources, no_thread};
use crate::source::{ArrivalClock, Stop};

const PAGE: &str = include_str!("page.html");
const SCRIPT: &str = include_str!("bench.js");
const SHEET: &str = include_str!("bench.css");
/// Nothing but what this server sends, and no framing.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Events that a slow browser may be behind.
const BEHIND: usize = 64;
/// Newest values are sent so often at most.
const EVERY: Duration = Duration::from_secs(1);
const COOKIE: &str = "sagnac-bench";
/// Bytes of a token.
const TOKEN_BYTES: usize = 16;

/// What a page is about.
#[derive(Clone)]
pub struct PageOf {
    /// The unit, in words.
    pub title: String,
    /// What is recorded, in words.
    pub subtitle: String,
    /// What is known.
    pub live: Live,
    /// How the sources are.
    pub sources: Sources,
    /// The time of arrivals.
    pub clock: ArrivalClock,
    /// Ends the recording.
    pub stop: Stop,
    /// What of a limit the curve may take, °/h, and which limit.
    pub share: Option<(f64, String)>,
    /// Unit of the rates that are shown.
    pub units: RateUnit,
    /// A log is replayed: its clock is not the one on the wall.
    pub is_replay: bool,
}

/// A page that is served.
pub struct Page {
    /// Its address.
    pub address: SocketAddr,
    /// What opens it, and may end the recording.
    pub token: String,
    ends: Ends,
    stop: Stop,
    /// The teller says the last and ends.
    is_over: Arc<AtomicBool>,
    server: JoinHandle<()>,
    teller: JoinHandle<()>,
}

/// The way of events to all browsers; `None` when there are no more.
type Ends = Arc<Mutex<Option<broadcast::Sender<Told>>>>;

/// An event, as every browser gets it.
#[derive(Clone)]
struct Told {
    name: &'static str,
    data: Arc<str>,
}

struct Site {
    of: PageOf,
    address: SocketAddr,
    token: String,
    ends: Ends,
}

impl Page {
    /// Serves it on an address; port 0 is any that is free.
    ///
    /// # Errors
    /// An address that is taken, or not of this computer.
    pub fn begin(page: PageOf, address: SocketAddr) -> Result<Self> {
        let failed = |e: &std::io::Error| {
            Error::input(
                format!("cannot serve the page: {e}"),
                "take a free port with --page 127.0.0.1:0, or serve no page with --page none",
            )
            .column("--page")
            .value(address.to_string())
        };
        let listener = TcpListener::bind(address).map_err(|e| failed(&e))?;
        listener.set_nonblocking(true).map_err(|e| failed(&e))?;
        let address = listener.local_addr().map_err(|e| failed(&e))?;
        let token = token()?;
        let ends: Ends = Arc::new(Mutex::new(Some(broadcast::channel(BEHIND).0)));
        let site = Arc::new(Site { of: page.clone(), address, token: token.clone(), ends: Arc::clone(&ends) });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build();
        let runtime = runtime.map_err(|e| failed(&e))?;
        let (stop, is_over) = (page.stop.clone(), Arc::new(AtomicBool::new(false)));
        let (tells, over) = (Arc::clone(&ends), Arc::clone(&is_over));
        let teller = spawn("page-events", move || tell(&page, &tells, &over)).map_err(|e| no_thread(&e))?;
        let closes = Arc::clone(&ends);
        let server =
            spawn("page", move || runtime.block_on(serve(site, listener, closes))).map_err(|e| no_thread(&e))?;
        Ok(Self { address, token, ends, stop, is_over, server, teller })
    }

    /// Ends the page: browsers get the end of the recording with its last fit, every stream of events ends, and the port is free.
    pub fn end(self) {
        self.stop.stop();
        self.is_over.store(true, Ordering::Release);
        self.teller.thread().unpark();
        let _ = self.teller.join();
        drop(self.ends.lock().unwrap_or_else(PoisonError::into_inner).take());
        let _ = self.server.join();
    }
}

/// A token that nobody can guess.
fn token() -> Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes)
        .map_err(|e| Error::input(format!("the system gives no random numbers: {e}"), "set --page none"))?;
    Ok(sagnac_log::ingest::hex(&bytes))
}

/// Time for the last events on their way.
const LAST_WORDS: Duration = Duration::from_millis(300);
/// How often it is looked whether the page is to end.
const LOOK: Duration = Duration::from_millis(100);

async fn serve(site: Arc<Site>, listener: TcpListener, ends: Ends) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    let routes = Router::new()
        .route("/", get(page))
        .route("/state.json", get(state))
        .route("/events", get(events))
        .route("/stop", post(stop))
        .route("/bench.js", get(|| fixed("text/javascript", SCRIPT)))
        .route("/bench.css", get(|| fixed("text/css", SHEET)))
        .route("/report.css", get(|| fixed("text/css", STYLE)))
        .route("/uplot.js", get(|| fixed("text/javascript", UPLOT_JS)))
        .route("/uplot.css", get(|| fixed("text/css", UPLOT_CSS)))
        .route("/uplot.licence", get(|| fixed("text/plain", UPLOT_LICENCE)))
        .layer(from_fn_with_state(Arc::clone(&site), guard))
        .with_state(site);
    let is_over = async move {
        let mut look = tokio::time::interval(LOOK);
        while ends.lock().unwrap_or_else(PoisonError::into_inner).is_some() {
            look.tick().await;
        }
    };
    // A client that sends half a request, or never reads, does not keep the bench from ending: what is open then is dropped.
    let listener = BoundedListener::new(listener);
    drop(tokio::spawn(async move { axum::serve(listener, routes).await }));
    is_over.await;
    tokio::time::sleep(LAST_WORDS).await;
}

async fn fixed(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, format!("{kind}; charset=utf-8"))], text).into_response()
}

/// Who may look, and what every answer says.
async fn guard(Shared(site): Shared<Arc<Site>>, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let is_one = request.headers().get_all(header::HOST).iter().count() == 1 && request.uri().authority().is_none();
    let mut answer = if !is_one || !site.is_own_name(host) {
        (StatusCode::MISDIRECTED_REQUEST, "this is not a name of the bench\n").into_response()
    } else if !site.address.ip().is_loopback() && !site.has_token(request.headers()) && request.uri().path() != "/" {
        (StatusCode::UNAUTHORIZED, "open the address with its token, as the bench printed it\n").into_response()
    } else {
        next.run(request).await
    };
    let fixed = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ];
    for (name, value) in fixed {
        answer.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    answer
}

impl Site {
    /// A name under which this address is asked for: itself, or on loopback `localhost`.
    fn is_own_name(&self, host: &str) -> bool {
        let name = host.strip_suffix(&format!(":{}", self.address.port())).unwrap_or(host);
        let ip = self.address.ip();
        let own = name.trim_start_matches('[').trim_end_matches(']').parse::<std::net::IpAddr>();
        match own {
            Ok(asked) => asked == ip || asked.is_loopback() || ip.is_unspecified(),
            Err(_) => ip.is_loopback() && name == "localhost",
        }
    }

    /// Browsers keep cookies by name and host, whatever the port: two benches on one computer have two.
    fn cookie(&self) -> String {
        format!("{COOKIE}-{}", self.address.port())
    }

    fn has_token(&self, headers: &HeaderMap) -> bool {
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        cookies
            .flat_map(|all| all.split(';'))
            .filter_map(|one| one.trim().split_once('='))
            .any(|(name, value)| name == self.cookie() && same(value, &self.token))
    }
}

/// Whether two texts are the same, in a time that does not tell where they differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}

#[derive(Deserialize)]
struct Opens {
    token: Option<String>,
}

/// The page. A right token becomes a cookie and leaves the address.
async fn page(Shared(site): Shared<Arc<Site>>, Query(opens): Query<Opens>, headers: HeaderMap) -> Response {
    if let Some(token) = opens.token {
        if !same(&token, &site.token) {
            return (StatusCode::UNAUTHORIZED, "a wrong token\n").into_response();
        }
        let cookie = format!("{}={token}; HttpOnly; SameSite=Strict; Path=/", site.cookie());
        return ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response();
    }
    if !site.address.ip().is_loopback() && !site.has_token(&headers) {
        let help = "open the address with its token, as the bench printed it\n";
        return (StatusCode::UNAUTHORIZED, help).into_response();
    }
    fixed("text/html", PAGE).await
}

async fn stop(Shared(site): Shared<Arc<Site>>, headers: HeaderMap) -> Response {
    let origin = headers.get(header::ORIGIN).and_then(|origin| origin.to_str().ok()).unwrap_or_default();
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
    // Another port of this computer is another site.
    let from_page = origin.strip_prefix("http://").is_some_and(|from| Some(from) == host && site.is_own_name(from));
    if !site.has_token(&headers) || !from_page {
        return (StatusCode::FORBIDDEN, "only the page that was opened with the token may end the recording\n")
            .into_response();
    }
    site.of.stop.stop();
    StatusCode::NO_CONTENT.into_response()
}

/// A source as it is shown.
#[derive(Serialize)]
struct ShownSource {
    name: String,
    state: SourceState,
    why: String,
    ago_s: Option<f64>,
    bytes: u64,
}

fn shown_sources(page: &PageOf) -> Vec<ShownSource> {
    let now_ns = page.clock.now_ns();
    let shown = |source: SourceStatus| ShownSource {
        ago_s: (source.last_ns > 0).then(|| (now_ns - source.last_ns) as f64 * 1e-9),
        name: source.name,
        state: source.state,
        why: source.why,
        bytes: source.bytes,
    };
    page.sources.now().into_iter().map(shown).collect()
}

/// The newest values, with their names: a page that was opened before the first row gets them too.
#[derive(Serialize)]
struct NowTold<'a> {
    names: &'a Names,
    now: &'a Now,
    sources: Vec<ShownSource>,
    counts: crate::decode::Counts,
    clock: crate::decode::ClockReport,
    failed: &'a Option<String>,
    ended: bool,
    points: Vec<TrendPoint>,
}

#[derive(Serialize)]
struct StudyTold<'a> {
    study: &'a Study,
}

#[derive(Serialize)]
struct EventsTold<'a> {
    events: &'a [crate::decode::Event],
    warnings: &'a [Warning],
}

/// Everything, for a page that is opened or was behind.
#[derive(Serialize)]
struct Whole<'a> {
    title: &'a str,
    subtitle: &'a str,
    seconds: Vec<TrendPoint>,
    means: Vec<TrendPoint>,
    may_stop: bool,
    is_replay: bool,
    share_dph: Option<f64>,
    share_of: Option<&'a str>,
    /// For the page alone: the values are in °/h.
    units: &'static str,
    dph_per_unit: f64,
    #[serde(flatten)]
    now: NowTold<'a>,
    #[serde(flatten)]
    study: StudyTold<'a>,
    #[serde(flatten)]
    events: EventsTold<'a>,
}

fn now_told<'a>(page: &PageOf, state: &'a LiveState, points: Vec<TrendPoint>) -> NowTold<'a> {
    NowTold {
        names: &state.names,
        now: &state.now,
        sources: shown_sources(page),
        counts: state.counts,
        clock: state.clock,
        failed: &state.failed,
        ended: page.stop.is_stopped(),
        points,
    }
}

async fn state(Shared(site): Shared<Arc<Site>>, headers: HeaderMap) -> Response {
    let may_stop = site.has_token(&headers);
    let page = &site.of;
    let text = page.live.look(|state| {
        let whole = Whole {
            title: &page.title,
            subtitle: &page.subtitle,
            seconds: state.seconds(),
            means: state.means(),
            may_stop,
            is_replay: page.is_replay,
            share_dph: page.share.as_ref().map(|(dph, _)| *dph),
            share_of: page.share.as_ref().map(|(_, limit)| limit.as_str()),
            units: page.units.name(),
            dph_per_unit: page.units.dph_per_unit(),
            now: now_told(page, state, Vec::new()),
            study: StudyTold { study: &state.study },
            events: EventsTold { events: &state.events, warnings: &state.warnings },
        };
        serde_json::to_string(&whole)
    });
    match text {
        Ok(text) => ([(header::CONTENT_TYPE, "application/json")], text).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn events(Shared(site): Shared<Arc<Site>>) -> Response {
    let told = site.ends.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(broadcast::Sender::subscribe);
    let Some(told) = told else { return StatusCode::SERVICE_UNAVAILABLE.into_response() };
    Sse::new(stream_of(told)).keep_alive(KeepAlive::default()).into_response()
}

fn stream_of(told: broadcast::Receiver<Told>) -> impl Stream<Item = std::result::Result<Event, Infallible>> {
    BroadcastStream::new(told).map(|told| {
        Ok(match told {
            Ok(told) => Event::default().event(told.name).data(&*told.data),
            Err(BroadcastStreamRecvError::Lagged(events)) => Event::default().event("lost").data(events.to_string()),
        })
    })
}

/// Tells all browsers what is new, until the page is over; that too.
fn tell(page: &PageOf, ends: &Ends, is_over: &AtomicBool) {
    let mut known = Versions::default();
    let mut last_s = f64::NEG_INFINITY;
    loop {
        // The newest values come once a second, even where nothing is new: a page must see that the bench is there.
        let waits = std::time::Instant::now();
        page.live.wait(known, EVERY);
        std::thread::park_timeout(EVERY.saturating_sub(waits.elapsed()));
        let is_last = is_over.load(Ordering::Acquire);
        let told = page.live.look(|state| {
            let mut told = Vec::new();
            let mut say = |name: &'static str, data: serde_json::Result<String>| {
                told.extend(data.ok().map(|data| Told { name, data: data.into() }));
            };
            let points: Vec<TrendPoint> = state.seconds().into_iter().filter(|point| point.t_s > last_s).collect();
            last_s = points.last().map_or(last_s, |point| point.t_s);
            say("now", serde_json::to_string(&now_told(page, state, points)));
            if state.versions.study != known.study {
                say("study", serde_json::to_string(&StudyTold { study: &state.study }));
            }
            if state.versions.events != known.events {
                say("events", serde_json::to_string(&EventsTold { events: &state.events, warnings: &state.warnings }));
            }
            known = state.versions;
            told
        });
        let ends = ends.lock().unwrap_or_else(PoisonError::into_inner);
        for (to, one) in ends.iter().flat_map(|to| told.iter().map(move |one| (to, one))) {
            // Nobody may be listening.
            let _ = to.send(one.clone());
        }
        if is_last {
            return;
        }
    }
}
