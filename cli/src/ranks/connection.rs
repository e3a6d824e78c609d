//! A connection between two ranks. A thread of its own reads: the death of the other side is seen at once, whatever this
//! process does.

use crate::threads;
use anyhow::Context;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, channel};

/// The length that says that no more messages will come.
const END: u64 = u64::MAX;

/// What is done when a connection ends without a word, by the thread that reads.
pub type OnLoss = Box<dyn FnOnce() + Send>;

/// A connection.
pub struct Connection {
    stream: TcpStream,
    inbox: Receiver<Vec<u8>>,
}

impl Connection {
    /// Of a stream.
    pub fn new(stream: TcpStream, lost: OnLoss) -> anyhow::Result<Self> {
        // A message is written at once: nothing comes that it could wait for.
        stream.set_nodelay(true).context("cannot talk to another rank")?;
        probe(&stream).context("cannot talk to another rank")?;
        let mut reader = stream.try_clone().context("cannot talk to another rank")?;
        let (sender, inbox) = channel();
        let read = move || {
            loop {
                match message(&mut reader) {
                    Ok(Some(bytes)) => {
                        let _ = sender.send(bytes);
                    }
                    Ok(None) => return,
                    Err(_) => return lost(),
                }
            }
        };
        // It ends with the connection.
        threads::spawn(read)?;
        Ok(Self { stream, inbox })
    }

    /// Sends a message.
    ///
    /// # Errors
    /// If the other side is gone.
    pub fn send(&mut self, bytes: &[u8]) -> anyhow::Result<()> {
        let mut write = || {
            self.stream.write_all(&(bytes.len() as u64).to_le_bytes())?;
            self.stream.write_all(bytes)
        };
        write().context("another rank is gone")
    }

    /// Waits for a message; nothing if no more will come.
    pub fn receive(&mut self) -> Option<Vec<u8>> {
        self.inbox.recv().ok()
    }

    /// Says that no more messages will come.
    pub fn end(&mut self) {
        // The other side may be gone already.
        let _ = self.stream.write_all(&END.to_le_bytes());
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // Not the reader's side: what the other one says at last would come to a closed listener.
        let _ = self.stream.shutdown(Shutdown::Write);
    }
}

/// The next message; none if there are no more.
fn message(stream: &mut TcpStream) -> std::io::Result<Option<Vec<u8>>> {
    let mut length = [0; 8];
    stream.read_exact(&mut length)?;
    let length = u64::from_le_bytes(length);
    if length == END {
        return Ok(None);
    }
    let length = usize::try_from(length).map_err(|_| ErrorKind::InvalidData)?;
    let mut bytes = vec![0; length];
    stream.read_exact(&mut bytes)?;
    Ok(Some(bytes))
}

/// The number at a place of some bytes.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).map_or(0, u32::from_le_bytes)
}

/// Has the system notice within 10 s that the other machine is gone.
#[cfg(any(target_os = "linux", target_os = "android"))]
fn probe(stream: &TcpStream) -> std::io::Result<()> {
    use nix::libc::{
        IPPROTO_TCP, SO_KEEPALIVE, SOL_SOCKET, TCP_KEEPCNT, TCP_KEEPIDLE, TCP_KEEPINTVL,
        TCP_USER_TIMEOUT, c_int, setsockopt, socklen_t,
    };
    use std::os::fd::AsRawFd;
    // A question after 3 s of silence, and two more; what is sent is taken within 9 s.
    let options = [
        (SOL_SOCKET, SO_KEEPALIVE, 1),
        (IPPROTO_TCP, TCP_KEEPIDLE, 3),
        (IPPROTO_TCP, TCP_KEEPINTVL, 2),
        (IPPROTO_TCP, TCP_KEEPCNT, 3),
        (IPPROTO_TCP, TCP_USER_TIMEOUT, 9000),
    ];
    for (level, name, value) in options {
        let (value, size): (c_int, _) = (value, size_of::<c_int>() as socklen_t);
        let at = std::ptr::from_ref(&value).cast();
        // SAFETY: the socket is open, and `at` has the number of bytes that is said.
        if unsafe { setsockopt(stream.as_raw_fd(), level, name, at, size) } != 0 {
            return Err(std::io::Error::last_os_error());
        }
    }
    Ok(())
}

/// The system decides when the other machine is gone.
#[cfg(not(any(target_os = "linux", target_os = "android")))]
fn probe(_: &TcpStream) -> std::io::Result<()> {
    Ok(())
}
