//! Requests that are answered: sent to an address of this server, by its own page, with the token if there is one.

use crate::error::{LiveError, LiveResult};
use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};
use std::net::{IpAddr, SocketAddr};

/// Number of random bytes in a token.
const TOKEN: usize = 16;

/// Rules for requests.
#[derive(Debug)]
pub(super) struct Guard {
    address: SocketAddr,
    token: Option<String>,
}

impl Guard {
    /// Creates the rules for a server at `address`. Without a `token`, addresses other than loopback have a random one.
    ///
    /// # Errors
    /// If the token cannot be part of a link, or no random numbers are available.
    pub fn new(address: SocketAddr, token: Option<String>) -> LiveResult<Self> {
        let token = match token {
            Some(token) if is_valid(&token) => Some(token),
            Some(_) => return Err(LiveError::WrongToken),
            None if address.ip().is_loopback() => None,
            None => Some(random_token()?),
        };
        Ok(Self { address, token })
    }

    /// Returns the link to the page.
    pub fn link(&self) -> String {
        let mut address = self.address;
        // A browser cannot open the address of all interfaces.
        if address.ip().is_unspecified() {
            address.set_ip(IpAddr::from([127, 0, 0, 1]));
        }
        match &self.token {
            Some(token) => format!("http://{address}/?token={token}"),
            None => format!("http://{address}/"),
        }
    }

    /// Returns the host of a request if it is an address of this server. Other names may resolve to this address in the
    /// browser of a victim (DNS rebinding).
    pub fn host(&self, headers: &HeaderMap) -> Option<String> {
        let host = headers.get(HOST)?.to_str().ok()?;
        // Any port may be forwarded to this server.
        let with_port = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok());
        let name = with_port.map_or(host, |(name, _)| name);
        let name = name.trim_start_matches('[').trim_end_matches(']');
        let own = self.address.ip();
        let is_own = match name.parse::<IpAddr>() {
            Ok(ip) => ip == own || own.is_unspecified() || own.is_loopback() && ip.is_loopback(),
            Err(_) => name.eq_ignore_ascii_case("localhost") && (own.is_loopback() || own.is_unspecified()),
        };
        is_own.then(|| host.to_owned())
    }

    /// Returns whether a request comes from the page of this server at `host`.
    pub fn is_own_page(&self, headers: &HeaderMap, host: &str) -> bool {
        let origin = headers.get(ORIGIN).and_then(|origin| origin.to_str().ok());
        origin.and_then(|origin| origin.strip_prefix("http://")).is_some_and(|origin| origin.eq_ignore_ascii_case(host))
    }

    /// Returns whether the query of a request contains the token, if there is one.
    pub fn admits(&self, query: Option<&str>) -> bool {
        let Some(token) = &self.token else { return true };
        value(query, "token").is_some_and(|given| are_equal(given, token))
    }
}

/// Returns the value of a parameter in a query.
pub(super) fn value<'a>(query: Option<&'a str>, name: &str) -> Option<&'a str> {
    query?.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))
}

/// Compares two texts in a time that does not depend on their contents.
fn are_equal(a: &str, b: &str) -> bool {
    let difference = a.bytes().zip(b.bytes()).fold(0, |difference, (a, b)| difference | (a ^ b));
    a.len() == b.len() && difference == 0
}

fn is_valid(token: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    (8..=64).contains(&token.len()) && token.chars().all(is_plain)
}

fn random_token() -> LiveResult<String> {
    let mut bytes = [0; TOKEN];
    getrandom::fill(&mut bytes).map_err(LiveError::Token)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: &str) -> HeaderMap {
        [(HOST, host.parse().unwrap()), (ORIGIN, origin.parse().unwrap())].into_iter().collect()
    }

    #[test]
    fn only_addresses_of_the_server_are_hosts() {
        let guard = Guard::new("127.0.0.1:8000".parse().unwrap(), None).unwrap();
        for host in ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "localhost:9000", "127.0.0.1"] {
            assert_eq!(guard.host(&headers(host, "")).as_deref(), Some(host));
        }
        for host in
            ["evil.example:8000", "localhost.evil.example:8000", "10.0.0.1:8000", "", ":8000", "127.0.0.1:8000:1"]
        {
            assert_eq!(guard.host(&headers(host, "")), None, "{host}");
        }
        assert!(guard.is_own_page(&headers("", "http://localhost:8000"), "localhost:8000"));
        for origin in ["http://evil.example", "https://localhost:8000", "null", "http://127.0.0.1:8000"] {
            assert!(!guard.is_own_page(&headers("", origin), "localhost:8000"), "{origin}");
        }
    }

    #[test]
    fn other_addresses_need_a_token() {
        let guard = Guard::new("0.0.0.0:8000".parse().unwrap(), None).unwrap();
        let link = guard.link();
        let token = link.strip_prefix("http://127.0.0.1:8000/?token=").unwrap();
        assert!(token.len() == 32 && guard.admits(Some(&format!("client=a&token={token}"))));
        for query in [None, Some(""), Some("token="), Some("token=0"), Some(&format!("token={token}0"))] {
            assert!(!guard.admits(query), "{query:?}");
        }
        assert!(guard.host(&headers("192.168.1.2:8000", "")).is_some());
        assert!(guard.host(&headers("evil.example:8000", "")).is_none());
        assert!(matches!(Guard::new("127.0.0.1:1".parse().unwrap(), Some("a b".into())), Err(LiveError::WrongToken)));
    }
}
