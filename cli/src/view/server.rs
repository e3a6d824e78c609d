//! The page on this computer alone, for as long as the program runs.

use super::page::Page;
use crate::interrupt::SignalGuard;
use crate::threads;
use anyhow::Context;
use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Longest time for which a connection may be silent.
const PATIENCE: Duration = Duration::from_secs(5);

/// Bytes of a request that are read at most.
const LONGEST_REQUEST: u64 = 16_384;

/// Serves the page until Ctrl-C, at a port of this computer that others cannot reach; opens a browser if that is wanted.
pub fn serve(page: &Page, port: Option<u16>, browser: bool) -> anyhow::Result<()> {
    let wanted = port.unwrap_or(0);
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, wanted))
        .with_context(|| format!("--port {wanted}: cannot listen at this port"))?;
    let address = format!("http://{}/", listener.local_addr()?);
    eprintln!("{address}: open it in a browser with WebGPU; Ctrl-C ends");
    let _keeper = SignalGuard::brief("the page is no longer served");
    if browser {
        open(&address);
    }
    std::thread::scope(|scope| {
        for stream in listener.incoming().flatten() {
            // Browsers open connections ahead of need: a silent one must not hold up the others, and one that goes away is
            // no failure.
            let same = stream.try_clone();
            if threads::spawn_in(scope, move || answer(page, stream)).is_err() {
                let _ = same.and_then(|stream| answer(page, stream));
            }
        }
    });
    Ok(())
}

/// Answers one request.
fn answer(page: &Page, mut stream: TcpStream) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut lines =
        BufReader::new(std::io::Read::take(stream.try_clone()?, LONGEST_REQUEST)).lines();
    let request = lines.next().transpose()?.unwrap_or_default();
    // To the end of the request, so that closing the connection is orderly.
    let mut is_meant = false;
    for line in lines {
        let line = line?;
        if line.is_empty() {
            break;
        }
        is_meant |= line.split_once(':').is_some_and(|(name, value)| {
            name.eq_ignore_ascii_case("host") && is_loopback(value.trim())
        });
    }
    let (status, kind, content) = if is_meant {
        found(page, &request)
    } else {
        ("403 Forbidden", "text/plain", "this page is served to this computer alone")
    };
    let length = content.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    )?;
    stream.write_all(content.as_bytes())
}

/// Returns whether a request names this computer as its host, at any port, which may be forwarded. Another name that leads
/// here is that of a page that would read what is served (DNS rebinding).
fn is_loopback(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|digit| digit.is_ascii_digit()) => name,
        _ => host,
    };
    name.eq_ignore_ascii_case("localhost") || ["127.0.0.1", "[::1]"].contains(&name)
}

/// Status, kind and content of what a request asks for.
fn found<'a>(page: &'a Page, request: &str) -> (&'static str, &'static str, &'a str) {
    let mut words = request.split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let path = target.split(['?', '#']).next().unwrap_or_default().trim_start_matches('/');
    let name = if path.is_empty() { "index.html" } else { path };
    let file = page.files().into_iter().find(|(known, _)| *known == name);
    match file.filter(|_| method == "GET") {
        Some((name, content)) if name.ends_with(".js") => ("200 OK", "text/javascript", content),
        Some((_, content)) => ("200 OK", "text/html", content),
        None => ("404 Not Found", "text/plain", "there is no such file"),
    }
}

/// Asks the system to show an address; where it cannot, the address has been printed.
fn open(address: &str) {
    let program = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let quiet = || Stdio::null();
    let mut command = Command::new(program);
    let opened = command.arg(address).stdin(quiet()).stdout(quiet()).stderr(quiet()).spawn();
    if let Err(error) = opened {
        eprintln!("note: no browser was opened ({program}: {error})");
    }
}
