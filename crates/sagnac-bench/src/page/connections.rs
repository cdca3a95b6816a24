//! Connections to the page: so many at most, each for as long as something moves on it.
//!
//! A browser that opens connections and says nothing, or never reads, gets none of the descriptors that the sources need: the listener accepts
//! another only when one has ended, and one on which nothing came or went for half a minute is closed. A stream of events says something
//! every 15 s.

use std::io::{Error, ErrorKind, Result};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// Far more than the browsers of a laboratory open.
pub(super) const MOST_CONNECTIONS: usize = 64;
/// Twice the time between two signs of life of a stream of events.
const QUIET: Duration = Duration::from_secs(30);

/// A listener with a bound.
pub(super) struct BoundedListener {
    listener: TcpListener,
    free: Arc<Semaphore>,
    quiet: Duration,
}

impl BoundedListener {
    pub(super) fn new(listener: TcpListener) -> Self {
        Self { listener, free: Arc::new(Semaphore::new(MOST_CONNECTIONS)), quiet: QUIET }
    }
}

impl Listener for BoundedListener {
    type Io = PageConnection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (PageConnection, SocketAddr) {
        loop {
            // Nobody closes the semaphore.
            let Ok(permit) = Arc::clone(&self.free).acquire_owned().await else { continue };
            let (stream, from) = Listener::accept(&mut self.listener).await;
            let (quiet, idle) = (self.quiet, Box::pin(sleep(self.quiet)));
            return (PageConnection { stream, quiet, idle, _permit: permit }, from);
        }
    }

    fn local_addr(&self) -> Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that ends when nothing moves.
pub(super) struct PageConnection {
    stream: TcpStream,
    quiet: Duration,
    idle: Pin<Box<Sleep>>,
    _permit: OwnedSemaphorePermit,
}

impl PageConnection {
    /// What the stream said; an end where it has waited for too long.
    fn moved<T>(&mut self, cx: &mut Context<'_>, said: Poll<Result<T>>) -> Poll<Result<T>> {
        if said.is_ready() {
            self.idle.as_mut().reset(Instant::now() + self.quiet);
            return said;
        }
        self.idle.as_mut().poll(cx).map(|()| Err(Error::new(ErrorKind::TimedOut, "nothing moves")))
    }
}

impl AsyncRead for PageConnection {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<Result<()>> {
        let said = Pin::new(&mut self.stream).poll_read(cx, buffer);
        self.moved(cx, said)
    }
}

impl AsyncWrite for PageConnection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<Result<usize>> {
        let said = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.moved(cx, said)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use super::*;

    /// A thousand connections that say nothing: no more than the bound are accepted, they end by themselves, and then one that asks is served.
    #[test]
    fn silent_connections_leave_room() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let (address, listener) = {
            let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
            listener.set_nonblocking(true).unwrap();
            (listener.local_addr().unwrap(), listener)
        };
        std::thread::spawn(move || {
            runtime.block_on(async {
                let listener = BoundedListener {
                    quiet: Duration::from_millis(50),
                    ..BoundedListener::new(TcpListener::from_std(listener).unwrap())
                };
                let free = Arc::clone(&listener.free);
                let left = axum::routing::get(move || async move { free.available_permits().to_string() });
                axum::serve(listener, axum::Router::new().route("/", left)).await
            })
        });
        let silent: Vec<_> = (0..300).filter_map(|_| std::net::TcpStream::connect(address).ok()).collect();
        assert_eq!(silent.len(), 300);
        let mut asks = std::net::TcpStream::connect(address).unwrap();
        asks.write_all(b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = String::new();
        asks.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        let free: usize = answer.lines().last().unwrap().parse().unwrap();
        assert!(free < MOST_CONNECTIONS, "{answer}");
    }
}
