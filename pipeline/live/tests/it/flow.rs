//! The flow of pictures over simulated lines.

use live::flow::{Flow, FlowLimits, PictureKind, SentPicture};
use std::collections::VecDeque;
use std::time::Duration;

const LIMITS: FlowLimits = FlowLimits { bits_per_second: None, pictures_per_second: 25.0 };
/// Finest quantiser.
const FINEST: u32 = 2;
/// Delay of the line in each direction.
const DELAY: f64 = 0.01;
/// Time to render a picture.
const RENDER: f64 = 0.05;

/// Mean figures of a part of the simulation.
#[derive(Debug)]
struct Means {
    quantiser: f64,
    /// Longest time from sending to arrival \[s\].
    longest: f64,
    /// Pictures per second.
    pictures: f64,
    bits_per_second: f64,
}

/// Line with a rate that may change, which delivers pictures in order.
struct Simulated {
    flow: Flow,
    now: f64,
    /// Time until which the line is busy.
    busy: f64,
    sequence: u32,
    /// Acknowledgements on their way back: time of arrival, and number of the picture.
    acknowledgements: VecDeque<(f64, u32)>,
}

impl Simulated {
    fn new() -> Self {
        let mut flow = Flow::new(LIMITS);
        flow.answered(Duration::from_secs_f64(2.0 * DELAY));
        Self { flow, now: 0.0, busy: 0.0, sequence: 0, acknowledgements: VecDeque::new() }
    }

    /// Moves through a scene for some seconds on a line of `rate` bits/s. The complexity of pictures changes slowly.
    fn run(&mut self, seconds: f64, rate: f64, jitter: f64) -> Means {
        let end = self.now + seconds;
        let mut means = Means { quantiser: 0.0, longest: 0.0, pictures: 0.0, bits_per_second: 0.0 };
        while self.now < end {
            while let Some(&(at, sequence)) = self.acknowledgements.front().filter(|(at, _)| *at <= self.now) {
                self.acknowledgements.pop_front();
                assert!(self.flow.acknowledged(Duration::from_secs_f64(at), sequence, Duration::ZERO));
            }
            if !self.flow.may_send(Duration::from_secs_f64(self.now)) {
                self.now += 0.001;
                continue;
            }
            let quantiser_scale = self.flow.quantiser(PictureKind::Moving, FINEST);
            self.now += RENDER;
            let complexity = 160_000.0 * (1.0 + 0.4 * (3.0 * self.now).sin());
            let bits = (complexity / f64::from(quantiser_scale) + 1000.0) as u64;
            let picture = SentPicture { sequence: self.sequence, bits, quantiser_scale, kind: PictureKind::Moving };
            self.flow.sent(Duration::from_secs_f64(self.now), picture);
            assert!(self.flow.outstanding() <= 2);
            self.busy = self.busy.max(self.now) + bits as f64 / rate;
            let noise = jitter * f64::from(self.sequence * 7919 % 13) / 13.0;
            let arrival = self.busy + DELAY + noise;
            self.acknowledgements.push_back((arrival + DELAY, self.sequence));
            self.sequence += 1;
            means.longest = means.longest.max(arrival - self.now);
            means.quantiser += f64::from(quantiser_scale);
            means.pictures += 1.0;
            means.bits_per_second += bits as f64 / seconds;
        }
        means.quantiser /= means.pictures;
        means.pictures /= seconds;
        means
    }
}

#[test]
fn quantisers_follow_the_line_and_no_queue_grows() {
    let mut line = Simulated::new();
    let mut settled = |rate: f64| {
        line.run(2.0, rate, 0.0);
        line.run(4.0, rate, 0.0)
    };
    let [wide, middle, thin] = [4e6, 1e6, 3e5].map(&mut settled);
    println!("{wide:?}\n{middle:?}\n{thin:?}");
    assert!(wide.quantiser < middle.quantiser && middle.quantiser < thin.quantiser);
    for (means, rate) in [(&wide, 4e6), (&middle, 1e6), (&thin, 3e5)] {
        assert!(means.longest < 0.3, "{means:?}");
        assert!(means.pictures >= 8.0, "{means:?}");
        assert!(means.bits_per_second < 1.01 * rate, "{means:?}");
    }
    assert!(thin.bits_per_second > 1.5e5, "the line is used: {thin:?}");

    // The line widens again.
    let again = settled(4e6);
    assert!(again.quantiser < 1.2 * wide.quantiser, "{again:?}");
}

#[test]
fn a_drop_of_the_line_delays_few_pictures() {
    let mut line = Simulated::new();
    line.run(4.0, 4e6, 0.0);
    let drop = line.run(1.5, 3e5, 0.0);
    assert!(drop.longest < 1.0, "two pictures of the wide line: {drop:?}");
    assert!(line.run(3.0, 3e5, 0.0).longest < 0.3);
}

#[test]
fn jitter_of_a_wide_line_does_not_coarsen_pictures() {
    let mut line = Simulated::new();
    let noisy = line.run(5.0, 1e8, 0.06);
    assert!(noisy.quantiser < 3.5, "{noisy:?}");
}

#[test]
fn credit_is_two_pictures() {
    let mut flow = Flow::new(LIMITS);
    let at = Duration::from_millis;
    for sequence in 0..2 {
        assert!(flow.may_send(at(0)));
        let kind = PictureKind::Moving;
        flow.sent(at(0), SentPicture { sequence, bits: 8000, quantiser_scale: 8, kind });
    }
    assert!(!flow.may_send(at(1)));
    assert!(!flow.acknowledged(at(2), 7, Duration::ZERO), "a picture that was never sent");
    assert!(flow.acknowledged(at(5), 1, Duration::from_secs(9)), "the second one acknowledges the first");
    assert_eq!((flow.outstanding(), flow.round_trip()), (0, 0.0));
    assert!(flow.may_send(at(5)) && flow.rate(at(5)) == 8000.0);

    // A limit of the user bounds the budget.
    flow.set_limits(FlowLimits { bits_per_second: Some(25_000), ..LIMITS });
    assert_eq!(flow.budget(), 1000.0);
    assert_eq!(flow.quantiser(PictureKind::Moving, 2), 64);
}
