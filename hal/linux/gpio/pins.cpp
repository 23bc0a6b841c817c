#include "hal/linux/gpio/pins.h"

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "protocol/base/try.h"

namespace nodal::hal::gpio {
namespace {

Status state_of(const LineName& name, const std::string& doing, int error) {
  if (error == 0) return {};
  if (error == ECANCELED) {
    return fail(Errc::kDeviceGone, "line " + name.text() + ": is safe for good; the program ends");
  }
  return fail(explain_use(name, doing, error));
}

}  // namespace

Status GpioOutputPin::set(bool high, Instant now, Duration lease) {
  NODAL_TRY(step(now));
  if (lease.ns() <= 0) {
    return fail(Errc::kBadValue, "line " + line_->name().text() + ": a lease must be longer than 0 ns");
  }
  constexpr Instant kFarthest = Instant::from_ns(INT64_MAX / 2);
  const Instant until = lease > kFarthest - now ? kFarthest : now + lease;
  wanted_.store((until.ns() << 1) | (high ? 1 : 0));
  if (runner_ != nullptr) runner_->ring();
  return {};
}

Status GpioOutputPin::step(Instant) {
  return state_of(line_->name(), "writing", line_->safe() ? ECANCELED : error_.load());
}

Instant GpioOutputPin::work(Instant now) {
  constexpr Duration kTryAgain = Duration::milliseconds(20);
  const std::int64_t wanted = wanted_.load();
  const Instant until = Instant::from_ns(wanted >> 1);
  const bool high = now < until && (wanted & 1) != 0;
  if (error_.load() != 0) return kNever;
  if (high != written_) {
    const int error = line_->write(high != active_low_);
    if (error != 0) {
      if (error == ECANCELED || error == ENODEV || ++refused_ >= kRefusedInRow) error_.store(error);
      return now + kTryAgain;
    }
    refused_ = 0;
    written_ = high;
  }
  return high ? until : kNever;
}

Status GpioInputPin::check_present() const { return state_of(name_, "reading", error_.load()); }

Result<bool> GpioInputPin::level() {
  NODAL_TRY(check_present());
  return level_.load();
}

Result<std::optional<PinEdge>> GpioInputPin::take_edge() {
  NODAL_TRY(check_present());
  return edges_.pop();
}

int GpioInputPin::prime() {
  const int level = line_->get();
  if (level < 0) return -level;
  reported_ = level == 1;
  level_.store(reported_);
  return 0;
}

void GpioInputPin::report(Instant at, bool high) {
  if (high == reported_) return;
  const Instant later = std::max(at, newest_ + Duration::nanoseconds(1));
  if (!edges_.push({later, high})) {
    lost_edges_ = true;
    return;  // reported_ stays, so the level is reported when there is room
  }
  newest_ = later;
  reported_ = high;
}

/// The number of events, or a negative errno.
int GpioInputPin::report_events() {
  std::array<LineEvent, kKernelQueue> events;
  const int count = line_->read_events(events);
  if (count == static_cast<int>(kKernelQueue)) lost_edges_ = true;
  const Instant now = system_.now();
  for (int i = 0; i < count; ++i) {
    const LineEvent& event = events[static_cast<std::size_t>(i)];
    report(std::min(event.at, now), event.high);
  }
  return count;
}

Instant GpioInputPin::work(Instant now) {
  constexpr Duration kTryAgain = Duration::milliseconds(50);
  if (error_.load() != 0) return kNever;
  int count = 0;
  int level = 0;
  // An edge between the two reads is in the next batch, with its time; so the level counts when that batch is empty.
  do {
    do count = report_events();
    while (count > 0);
    if (count < 0 || (level = line_->get()) < 0) {
      error_.store(count < 0 ? -count : -level);
      return kNever;
    }
  } while ((level == 1) != reported_ && (count = report_events()) > 0);
  level_.store(level == 1);
  report(system_.now(), level == 1);
  if (std::exchange(lost_edges_, false)) bursts_.fetch_add(1);
  return reported_ != (level == 1) ? now + kTryAgain : kNever;
}

Pins::~Pins() { runner_.reset(); }

Result<GpioOutputPin*> Pins::add_output(const PinRequest& request) {
  NODAL_TRY_ASSIGN(auto line, claim_output(system_, request.line, request.active_low));
  return &outputs_.emplace_back(std::move(line), request.active_low);
}

Result<GpioInputPin*> Pins::add_input(const PinRequest& request) {
  Claim claim = system_.claim_input(request.line, {request.active_low, request.bias, EdgeKind::kBoth});
  if (!claim.line) return fail(explain_claim(system_, request.line, claim.error));
  GpioInputPin& input = inputs_.emplace_back(request.line, std::move(claim.line), system_);
  if (const int error = input.prime(); error != 0) return fail(explain_use(request.line, "reading", error));
  return &input;
}

Status Pins::start() {
  if (outputs_.empty() && inputs_.empty()) return {};
  RunOptions options{"nodal-pins"};
  for (GpioInputPin& input : inputs_) options.wake_on.push_back(&input.line());
  try {
    runner_ = system_.run(options, [this](Instant now) { return step(now); }).runner;
  } catch (const std::system_error& error) {
    return fail(Errc::kOverload, std::string("the system refuses the thread of the panel's lines: ") +
                                     error.code().message() + "; raise the limit on processes (ulimit -u, TasksMax=)");
  }
  for (GpioOutputPin& output : outputs_) output.attach(runner_.get());
  return {};
}

void Pins::make_safe() noexcept {
  for (GpioOutputPin& output : outputs_) output.make_safe();
}

Instant Pins::step(Instant now) {
  Instant next = kNever;
  for (GpioOutputPin& output : outputs_) next = std::min(next, output.work(now));
  for (GpioInputPin& input : inputs_) next = std::min(next, input.work(now));
  return next;
}

}  // namespace nodal::hal::gpio
