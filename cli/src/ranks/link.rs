//! Connections of the ranks of one job: from every other rank to the first one, which writes where it listens into a
//! folder that all of them see.

use super::connection::{self, Connection, OnLoss};
use crate::output::Output;
use crate::threads;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Where the first rank listens, in the folder.
pub const FILE: &str = "ranks.json";
/// For so long ranks wait for each other to come.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often to look.
const LOOK: Duration = Duration::from_millis(20);
/// For so long one may take to say who it is.
const GREETING: Duration = Duration::from_secs(5);

/// What [`FILE`] says.
#[derive(Serialize, Deserialize)]
struct Address {
    host: String,
    port: u16,
    /// What whoever comes has to know.
    token: String,
}

/// The first rank, to which others come.
pub struct Listener {
    path: PathBuf,
    size: u32,
    closed: Arc<AtomicBool>,
    arrivals: Receiver<anyhow::Result<(u32, TcpStream)>>,
    thread: Option<JoinHandle<()>>,
}

impl Listener {
    /// Listens, and says in the folder where; whoever comes must say `facts`, too.
    pub fn open(folder: &Path, size: u32, facts: String) -> anyhow::Result<Self> {
        // Nobody else needs to reach ranks of one machine.
        let ip = if super::is_one_host(size) { Ipv4Addr::LOCALHOST } else { Ipv4Addr::UNSPECIFIED };
        let listener = TcpListener::bind((ip, 0)).context("cannot listen to other ranks")?;
        listener.set_nonblocking(true).context("cannot listen to other ranks")?;
        let port = listener.local_addr().context("cannot listen to other ranks")?.port();
        let word = || RandomState::new().build_hasher().finish();
        let token = format!("{:016x}{:016x}", word(), word());
        let address = Address { host: network_name(), port, token: token.clone() };
        let path = folder.join(FILE);
        Output::new(&path, "")?.write(serde_json::to_string(&address)?.as_bytes())?;
        let (sender, arrivals) = channel();
        let closed = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&closed);
        let listen = move || {
            while !stop.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => {
                        if let Some(arrival) = admitted(stream, &token, &facts).transpose() {
                            let _ = sender.send(arrival);
                        }
                    }
                    Err(_) => std::thread::sleep(LOOK),
                }
            }
        };
        let thread = Some(threads::spawn(listen)?);
        Ok(Self { path, size, closed, arrivals, thread })
    }

    /// Waits until all have come: their connections by rank, the second rank's first.
    ///
    /// # Errors
    /// If one has not come within a minute, or is of another program.
    pub fn gather(self, lost: impl Fn(u32) -> OnLoss) -> anyhow::Result<Vec<Connection>> {
        let mut all: Vec<Option<Connection>> = (1..self.size).map(|_| None).collect();
        let clock = Instant::now();
        while let Some(missing) = all.iter().position(Option::is_none) {
            let left = PATIENCE.saturating_sub(clock.elapsed());
            let Ok(arrival) = self.arrivals.recv_timeout(left) else {
                bail!("rank {} has not come within {} s", missing + 1, PATIENCE.as_secs());
            };
            let (rank, stream) = arrival?;
            let Some(place) = all.get_mut((rank as usize).wrapping_sub(1)) else {
                bail!("rank {rank} of {} has come", self.size);
            };
            *place = Some(Connection::new(stream, lost(rank))?);
        }
        Ok(all.into_iter().flatten().collect())
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.closed.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
        // What is left behind does no harm.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The rank behind a connection, if it is one of this job's.
fn admitted(
    mut stream: TcpStream,
    token: &str,
    facts: &str,
) -> anyhow::Result<Option<(u32, TcpStream)>> {
    let mut said = || {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(GREETING))?;
        let mut known = vec![0; token.len()];
        stream.read_exact(&mut known)?;
        let mut numbers = [0; 8];
        stream.read_exact(&mut numbers)?;
        let [rank, length] = [0, 4].map(|k| connection::u32_at(&numbers, k));
        if known != token.as_bytes() || length > 4096 {
            return Err(ErrorKind::InvalidData.into());
        }
        let mut words = vec![0; length as usize];
        stream.read_exact(&mut words)?;
        stream.write_all(&[1])?;
        stream.set_read_timeout(None)?;
        Ok::<_, std::io::Error>((rank, String::from_utf8_lossy(&words).into_owned()))
    };
    // Somebody else, or one that comes again.
    let Ok((rank, words)) = said() else { return Ok(None) };
    if words != facts {
        bail!("rank {rank} does not work as rank 0 does: it has {words}, rank 0 has {facts}");
    }
    Ok(Some((rank, stream)))
}

/// Connects the rank `rank` to the first one, once that listens; `facts` must be the same there.
///
/// # Errors
/// If it does not within a minute.
pub fn join(folder: &Path, rank: u32, facts: &str, lost: OnLoss) -> anyhow::Result<Connection> {
    let (path, clock) = (folder.join(FILE), Instant::now());
    loop {
        if let Some(stream) = reached(&path, rank, facts) {
            return Connection::new(stream, lost);
        }
        if clock.elapsed() > PATIENCE {
            bail!(
                "rank 0 cannot be reached as {} says: where each rank has a command of its own, set {}=1",
                path.display(),
                super::ALONE
            );
        }
        std::thread::sleep(LOOK);
    }
}

/// A connection, if the first rank of this job is where the file says: an earlier job may have left it.
fn reached(path: &Path, rank: u32, facts: &str) -> Option<TcpStream> {
    let address: Address = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    let mut stream = places(&address)
        .into_iter()
        .find_map(|place| TcpStream::connect_timeout(&place, Duration::from_secs(2)).ok())?;
    stream.set_read_timeout(Some(GREETING)).ok()?;
    let length = u32::try_from(facts.len()).ok()?;
    let numbers = [rank.to_le_bytes(), length.to_le_bytes()].concat();
    stream.write_all(&[address.token.as_bytes(), &numbers, facts.as_bytes()].concat()).ok()?;
    let mut yes = [0];
    stream.read_exact(&mut yes).ok()?;
    stream.set_read_timeout(None).ok()?;
    (yes == [1]).then_some(stream)
}

fn places(address: &Address) -> Vec<SocketAddr> {
    if address.host == network_name() {
        return vec![SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), address.port)];
    }
    let all = (address.host.as_str(), address.port).to_socket_addrs();
    all.map(|all| all.filter(SocketAddr::is_ipv4).collect()).unwrap_or_default()
}

/// What other machines call this one.
fn network_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    name.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quietly() -> OnLoss {
        Box::new(|| ())
    }

    /// Messages come as they were sent, whoever comes first; what an earlier job has left is passed over, and so is
    /// whoever does not know the token.
    #[test]
    fn exact_messages_arrive_as_they_were_sent() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().to_owned();
        let old = Address { host: network_name(), port: 1, token: "0".repeat(32) };
        std::fs::write(at.join(FILE), serde_json::to_string(&old).unwrap()).unwrap();
        let others: Vec<_> = [2, 1]
            .map(|rank| {
                let at = at.clone();
                std::thread::spawn(move || {
                    let mut connection = join(&at, rank, "same", quietly()).unwrap();
                    connection.send(&vec![rank as u8; 3_000_000]).unwrap();
                    [connection.receive(), connection.receive()]
                })
            })
            .into();
        std::thread::sleep(Duration::from_millis(100));
        let listener = Listener::open(&at, 3, "same".to_owned()).unwrap();
        let address: Address =
            serde_json::from_slice(&std::fs::read(at.join(FILE)).unwrap()).unwrap();
        let mut stranger = TcpStream::connect(places(&address)[0]).unwrap();
        stranger.write_all(&[7; 64]).unwrap();
        let mut connections = listener.gather(|_| quietly()).unwrap();
        for (k, connection) in connections.iter_mut().enumerate() {
            assert_eq!(connection.receive(), Some(vec![k as u8 + 1; 3_000_000]));
            connection.send(&[k as u8, 9]).unwrap();
            connection.end();
        }
        let found: Vec<[Option<Vec<u8>>; 2]> =
            others.into_iter().map(|other| other.join().unwrap()).collect();
        assert_eq!(found, [[Some(vec![1, 9]), None], [Some(vec![0, 9]), None]]);
        assert!(!at.join(FILE).exists());
    }

    #[test]
    fn exact_ranks_that_work_otherwise_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().to_owned();
        let listener = Listener::open(&at, 2, "Avx2".to_owned()).unwrap();
        let other = std::thread::spawn(move || join(&at, 1, "Avx512", quietly()).is_ok());
        let error = listener.gather(|_| quietly()).err().unwrap().to_string();
        assert!(error.contains("Avx512") && error.contains("Avx2"), "{error}");
        assert!(other.join().unwrap());
    }

    /// The end of a process without a word is noticed at once, also by one that does not wait for a message.
    #[test]
    fn exact_a_lost_connection_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().to_owned();
        let listener = Listener::open(&at, 2, String::new()).unwrap();
        let other = std::thread::spawn(move || join(&at, 1, "", quietly()).unwrap());
        let (sender, told) = channel();
        let lost = move |rank| -> OnLoss {
            let sender = sender.clone();
            Box::new(move || sender.send(rank).unwrap())
        };
        let connections = listener.gather(lost).unwrap();
        drop(other.join().unwrap());
        assert_eq!(told.recv_timeout(Duration::from_secs(5)), Ok(1));
        drop(connections);
    }
}
