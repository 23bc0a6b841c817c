#include "tests/support/gpio_chips.h"

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <thread>

namespace nodal::test {

using hal::gpio::Claim;
using hal::gpio::EdgeKind;
using hal::gpio::kNever;

class GpioChips::ClaimedLine final : public hal::gpio::Line {
 public:
  ClaimedLine(GpioChips& chips, LineName name) : chips_(chips), name_(std::move(name)) {}
  ~ClaimedLine() override { chips_.release(name_); }
  int set(bool high) override { return chips_.set(name_, high); }
  int get() override { return chips_.get(name_); }
  int read_events(std::span<LineEvent> into) override { return chips_.read_events(name_, into); }
  const LineName& name() const { return name_; }

 private:
  GpioChips& chips_;
  const LineName name_;
};

/// poke() calls its step, or wakes a thread that does.
class GpioChips::StepRunner final : public hal::gpio::Runner {
 public:
  StepRunner(GpioChips& chips, const hal::gpio::RunOptions& options, hal::gpio::Step step)
      : chips_(chips), step_(std::move(step)) {
    for (const hal::gpio::Line* line : options.wake_on)
      wakes_on.push_back(static_cast<const ClaimedLine*>(line)->name());
    {
      const std::lock_guard lock(chips_.mutex_);
      chips_.runners_.push_back(this);
    }
    if (chips_.threads) thread_ = std::thread([this] { run(); });
    poke();
  }
  ~StepRunner() override {
    {
      const std::lock_guard lock(chips_.mutex_);
      std::erase(chips_.runners_, this);
      stop_ = true;
    }
    chips_.changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }
  void ring() override { poke(); }

  /// Returns when the step is done or hangs.
  void poke() {
    if (!thread_.joinable()) return once();
    std::unique_lock lock(chips_.mutex_);
    poked_ = true;
    chips_.changed_.notify_all();
    chips_.changed_.wait(lock, [&] { return (!poked_ && !stepping_) || chips_.hanging_ > 0; });
  }
  Instant next() const { return next_; }

  std::vector<LineName> wakes_on;

 private:
  void once() {
    const Instant next = step_(chips_.now());
    const std::lock_guard lock(chips_.mutex_);
    next_ = next;
    ++chips_.steps_;
  }
  void run() {
    std::unique_lock lock(chips_.mutex_);
    for (;;) {
      chips_.changed_.wait(lock, [&] { return poked_ || stop_; });
      if (stop_) return;
      poked_ = false;
      stepping_ = true;
      lock.unlock();
      once();
      lock.lock();
      stepping_ = false;
      chips_.changed_.notify_all();
    }
  }

  GpioChips& chips_;
  const hal::gpio::Step step_;
  Instant next_ = kNever;
  bool poked_ = false, stepping_ = false, stop_ = false;
  std::thread thread_;
};

void GpioChips::add(const std::string& chip, const std::string& label, std::uint32_t lines) {
  labels_[label] = chip;
  for (std::uint32_t i = 0; i < lines; ++i) wires_[{chip, i}] = {};
}

void GpioChips::connect(const LineName& output, const LineName& input) { connected_[key(output)] = key(input); }

GpioChips::Key GpioChips::key(const LineName& line) const {
  const auto label = labels_.find(line.chip);
  return {label == labels_.end() ? line.chip : label->second, line.offset};
}

void GpioChips::hold(const LineName& line, const std::string& program) {
  const std::lock_guard lock(mutex_);
  wires_.at(key(line)).holder = program;
}

/// Requires the lock. Returns true if an edge was queued.
bool GpioChips::change(const Key& key, bool high) {
  Wire& wire = wires_.at(key);
  if (wire.high == high) return false;
  wire.high = high;
  const bool rises = high != wire.options.active_low;
  const Instant at = Instant::from_ns(now_ns_);
  wire.history.push_back({at, high});
  bool queued = false;
  const EdgeKind edges = wire.options.edges;
  if (wire.input && (edges == EdgeKind::kBoth || (edges == EdgeKind::kRising) == rises)) {
    const bool full = wire.events.size() == hal::gpio::kKernelQueue;
    queued = !full || discards_oldest;
    if (full) ++discarded_;
    if (full && discards_oldest) {
      wire.events.pop_front();
      wire.events.front().after_gap = true;
    }
    if (queued) wire.events.push_back({stamp ? stamp(at) : at, rises});
  }
  if (const auto other = connected_.find(key); other != connected_.end()) queued |= change(other->second, high);
  return queued;
}

void GpioChips::drive_burst(const LineName& line, const std::vector<bool>& levels) {
  {
    const std::lock_guard lock(mutex_);
    for (const bool high : levels) change(key(line), high);
  }
  wake(line);
}

void GpioChips::wake(const LineName& line) {
  std::vector<StepRunner*> awake;
  {
    const std::lock_guard lock(mutex_);
    for (StepRunner* runner : runners_) {
      if (std::count(runner->wakes_on.begin(), runner->wakes_on.end(), line) > 0) awake.push_back(runner);
    }
  }
  for (StepRunner* runner : awake) runner->poke();
}

void GpioChips::unplug(const std::string& chip) {
  {
    const std::lock_guard lock(mutex_);
    unplugged_.insert(chip);
  }
  for (StepRunner* runner : runners_) runner->poke();
}

void GpioChips::hang(const LineName& line) {
  const std::lock_guard lock(mutex_);
  hung_.insert(key(line));
}

void GpioChips::unhang() {
  const std::lock_guard lock(mutex_);
  hung_.clear();
  changed_.notify_all();
}

void GpioChips::pass(Duration time) {
  const std::int64_t end = now().ns() + time.ns();
  constexpr int kSpins = 100;
  for (int spins = 0;;) {
    StepRunner* first = nullptr;
    std::int64_t at = end;
    {
      const std::lock_guard lock(mutex_);
      for (StepRunner* runner : runners_) {
        if (hanging_ > 0 || runner->next().ns() > at) continue;
        at = runner->next().ns();
        first = runner;
      }
      spins = at <= now_ns_ ? spins + 1 : 0;
      if (spins > kSpins) throw std::logic_error("a thread spins");
      if (first != nullptr && lateness) at += lateness().ns();
      now_ns_ = std::max(now_ns_, at);
    }
    if (first == nullptr) return;
    first->poke();
  }
}

void GpioChips::suspend(Duration time) {
  const std::lock_guard lock(mutex_);
  now_ns_ += time.ns();
}

bool GpioChips::wire(const LineName& line) const {
  const std::lock_guard lock(mutex_);
  return wires_.at(key(line)).high;
}

std::vector<GpioChips::LineEvent> GpioChips::history(const LineName& line) const {
  const std::lock_guard lock(mutex_);
  return wires_.at(key(line)).history;
}

int GpioChips::claimed() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(
      std::count_if(wires_.begin(), wires_.end(), [](const auto& wire) { return wire.second.holder == "nodald"; }));
}

std::uint64_t GpioChips::discarded_edges() const {
  const std::lock_guard lock(mutex_);
  return discarded_;
}

std::uint64_t GpioChips::steps() const {
  const std::lock_guard lock(mutex_);
  return steps_;
}

std::pair<GpioChips::Wire*, int> GpioChips::claimable(const LineName& line) {
  if (const auto error = claim_error.find(line.text()); error != claim_error.end()) return {nullptr, error->second};
  const auto [chip, offset] = key(line);
  if (unplugged_.contains(chip) || !wires_.contains({chip, 0})) return {nullptr, ENOENT};
  const auto found = wires_.find({chip, offset});
  if (found == wires_.end()) return {nullptr, EINVAL};
  if (!found->second.holder.empty()) return {nullptr, EBUSY};
  return {&found->second, 0};
}

Claim GpioChips::claim_output(const LineName& line, bool high) {
  const std::lock_guard lock(mutex_);
  const auto [wire, error] = claimable(line);
  if (wire == nullptr) return {nullptr, error};
  wire->holder = "nodald";
  wire->input = false;
  wire->options = {};
  change(key(line), high);
  return {std::make_unique<ClaimedLine>(*this, line), 0};
}

Claim GpioChips::claim_input(const LineName& line, const hal::gpio::InputOptions& options) {
  const std::lock_guard lock(mutex_);
  const auto [wire, error] = claimable(line);
  if (wire == nullptr) return {nullptr, error};
  wire->holder = "nodald";
  wire->input = true;
  wire->options = options;
  wire->events.clear();
  wire->was_full = false;
  return {std::make_unique<ClaimedLine>(*this, line), 0};
}

void GpioChips::release(const LineName& line) {
  const std::lock_guard lock(mutex_);
  wires_.at(key(line)).holder.clear();
}

std::string GpioChips::holder(const LineName& line) {
  const std::lock_guard lock(mutex_);
  const auto found = wires_.find(key(line));
  return found == wires_.end() ? "" : found->second.holder;
}

std::vector<std::string> GpioChips::chips() {
  std::vector<std::string> all;
  for (const auto& [label, chip] : labels_) all.push_back(chip + " (" + label + ")");
  return all;
}

Instant GpioChips::now() {
  const std::lock_guard lock(mutex_);
  return Instant::from_ns(now_ns_);
}

hal::gpio::Running GpioChips::run(const hal::gpio::RunOptions& options, hal::gpio::Step step) {
  if (refuse_threads) throw std::system_error(EAGAIN, std::generic_category());
  std::string notice;
  if (options.realtime && refuse_realtime) notice = "not permitted";
  return {std::make_unique<StepRunner>(*this, options, std::move(step)), notice};
}

int GpioChips::set(const LineName& line, bool high) {
  if (before_set) {
    if (const int error = before_set(line, high); error != 0) return error;
  }
  bool queued = false;
  {
    std::unique_lock lock(mutex_);
    const Key where = key(line);
    if (hung_.contains(where)) {
      ++hanging_;
      changed_.notify_all();
      changed_.wait(lock, [&] { return !hung_.contains(where); });
      --hanging_;
    }
    if (unplugged_.contains(where.first)) return ENODEV;
    queued = change(where, high);
    now_ns_ += write_time.ns();
  }
  if (queued) wake(line);
  return 0;
}

int GpioChips::get(const LineName& line) {
  if (before_read) {
    if (const int error = before_read(line); error != 0) return -error;
  }
  const std::lock_guard lock(mutex_);
  if (unplugged_.contains(key(line).first)) return -ENODEV;
  const Wire& wire = wires_.at(key(line));
  return wire.high != wire.options.active_low ? 1 : 0;
}

int GpioChips::read_events(const LineName& line, std::span<LineEvent> into) {
  if (before_read) {
    if (const int error = before_read(line); error != 0) return -error;
  }
  const std::lock_guard lock(mutex_);
  if (unplugged_.contains(key(line).first)) return -ENODEV;
  Wire& wire = wires_.at(key(line));
  auto& events = wire.events;
  const std::size_t count = std::min(into.size(), events.size());
  std::copy_n(events.begin(), count, into.begin());
  if (count > 0 && std::exchange(wire.was_full, !discards_oldest && count == hal::gpio::kKernelQueue)) {
    into[0].after_gap = true;
  }
  events.erase(events.begin(), events.begin() + static_cast<std::ptrdiff_t>(count));
  return static_cast<int>(count);
}

}  // namespace nodal::test
