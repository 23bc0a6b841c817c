#include "tests/support/iidc_bus.h"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace nodal::test {

class IidcBus::Source final : public hal::iidc::FrameSource {
 public:
  Source(IidcBus& bus, int generation, std::size_t buffers, std::size_t bytes)
      : bus_(bus), generation_(generation), slots_(buffers) {
    for (Slot& slot : slots_) slot.bytes.resize(bytes);
    const std::lock_guard lock(bus_.mutex_);
    ++bus_.sources_;
  }
  ~Source() override {
    end();
    const std::lock_guard lock(bus_.mutex_);
    --bus_.sources_;
  }

  int begin() override {
    const std::lock_guard lock(bus_.mutex_);
    if (bus_.gone(generation_)) return ENODEV;
    if (bus_.slots_ == &slots_) return EBUSY;  // its transfers were not ended
    bus_.slots_ = &slots_;
    bus_.starved_ = false;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (slots_[i].state == Slot::State::kIdle) queue(i);
    }
    return 0;
  }
  void end() override {
    const std::lock_guard lock(bus_.mutex_);
    if (bus_.slots_ != &slots_) return;
    bus_.slots_ = nullptr;
    for (Slot& slot : slots_) {
      if (slot.state != Slot::State::kLent) slot.state = Slot::State::kIdle;
    }
    bus_.queue_.clear();
    bus_.done_.clear();
  }
  int take(hal::iidc::RawFrame& frame) override {
    const std::lock_guard lock(bus_.mutex_);
    if (!bus_.gone(generation_)) bus_.deliver(bus_.clock_.now());
    if (bus_.slots_ == &slots_ && !bus_.done_.empty() && bus_.broken_takes_ == 0) {
      const Done done = bus_.done_.front();
      bus_.done_.pop_front();
      Slot& slot = slots_[done.slot];
      slot.state = Slot::State::kLent;
      const std::size_t bytes = std::min<std::size_t>(bus_.registers.picture_bytes(), slot.bytes.size());
      frame = {done.slot, slot.bytes.data(), bytes, done.frame.done, false, false, 0, done.starved};
      if (bus_.torn_.contains(done.frame.number)) frame.bytes /= 2;
      frame.damaged = bus_.damaged_.contains(done.frame.number);
      return 0;
    }
    if (bus_.gone(generation_)) return ENODEV;
    if (bus_.broken_takes_ == 0) return EAGAIN;
    --bus_.broken_takes_;
    return EIO;
  }
  int give_back(std::size_t slot) override {
    const std::lock_guard lock(bus_.mutex_);
    NODAL_ASSERT(slots_.at(slot).state == Slot::State::kLent);
    if (bus_.gone(generation_)) return ENODEV;
    if (bus_.refused_buffers_ > 0) {
      --bus_.refused_buffers_;
      return EIO;
    }
    bus_.deliver(bus_.clock_.now());
    queue(slot);
    return 0;
  }
  std::size_t buffers() const override { return slots_.size(); }
  void add_wake_ups(hal::WakeUps& to) const override { to.on({kDescriptor, true, false}); }

 private:
  void queue(std::size_t slot) {
    slots_[slot].state = Slot::State::kQueued;
    slots_[slot].starved = std::exchange(bus_.starved_, false);
    bus_.queue_.push_back(slot);
  }

  IidcBus& bus_;
  const int generation_;
  std::vector<Slot> slots_;
};

class IidcBus::OpenCamera final : public hal::iidc::Device {
 public:
  OpenCamera(IidcBus& bus, int generation, hal::iidc::CameraInfo info)
      : bus_(bus), generation_(generation), info_(std::move(info)) {}
  ~OpenCamera() override {
    const std::lock_guard lock(bus_.mutex_);
    --bus_.open_;
  }
  const hal::iidc::CameraInfo& info() const override { return info_; }
  int read(std::uint64_t offset, std::uint32_t& value) override { return bus_.read(offset, value, generation_); }
  int write(std::uint64_t offset, std::uint32_t value) override { return bus_.write(offset, value, generation_); }
  bool gone() const override {
    const std::lock_guard lock(bus_.mutex_);
    return bus_.gone(generation_);
  }
  int make_source(std::size_t buffers, std::size_t bytes, std::unique_ptr<hal::iidc::FrameSource>& source) override {
    source = std::make_unique<Source>(bus_, generation_, buffers, bytes);
    return 0;
  }

 private:
  IidcBus& bus_;
  const int generation_;
  const hal::iidc::CameraInfo info_;
};

int IidcBus::open(std::uint64_t guid, std::unique_ptr<hal::iidc::Device>& device) {
  const std::lock_guard lock(mutex_);
  if (!there_ || guid != kGuid) return ENODEV;
  if (opening_error_ != 0) return opening_error_;
  ++open_;
  device = std::make_unique<OpenCamera>(*this, generation_,
                                        hal::iidc::CameraInfo{kGuid, "Maker", "Model", IidcRegisters::kBase, usb});
  return 0;
}

std::vector<hal::iidc::CameraInfo> IidcBus::list() {
  const std::lock_guard lock(mutex_);
  if (!there_) return {};
  return {{kGuid, "Maker", "Model"}};
}

int IidcBus::read(std::uint64_t offset, std::uint32_t& value, int generation) {
  if (before_read) {
    if (const int error = before_read(offset); error != 0) return error;
  }
  const std::lock_guard lock(mutex_);
  if (gone(generation)) return ENODEV;
  return registers.read(offset, value) ? 0 : EIO;
}

int IidcBus::write(std::uint64_t offset, std::uint32_t value, int generation) {
  if (before_write) {
    if (const int error = before_write(offset, value); error != 0) return error;
  }
  const std::lock_guard lock(mutex_);
  if (gone(generation)) return ENODEV;
  if (ignored_.contains(offset)) return 0;
  const Instant now = clock_.now();
  deliver(now);
  if (!registers.write(offset, value)) return EIO;
  const Change change{now, registers.get(0x81C) & 0xFFF, registers.get(0x820) & 0xFFF};
  const bool newest = changes_.empty()
                          ? change.shutter == shutter_ && change.gain == gain_
                          : change.shutter == changes_.back().shutter && change.gain == changes_.back().gain;
  if (!newest) changes_.push_back(change);
  if (registers.transmits() && !streams_) {
    shutter_ = change.shutter;
    gain_ = change.gain;
    changes_.clear();
    coming_.clear();
    next_done_ = now + period();
    own_clock_from_.reset();
    displaced_ = false;
  }
  streams_ = registers.transmits();
  return 0;
}

Duration IidcBus::period() const { return Duration::nanoseconds(static_cast<std::int64_t>(1e9 / registers.hertz())); }

Duration IidcBus::exposure() const { return Duration::microseconds(std::int64_t{10} * shutter_); }

/// A frame whose last byte arrives at `done`.
void IidcBus::expose(Instant done) {
  const Instant begun = done - kReadout - exposure();
  for (Change& change : changes_) {
    if (begun >= change.at) --change.frames_left;
  }
  while (!changes_.empty() && changes_.front().frames_left < 0) {
    shutter_ = changes_.front().shutter;
    gain_ = changes_.front().gain;
    changes_.pop_front();
  }
  coming_.push_back({number_++, done, shutter_, gain_});
}

void IidcBus::expose_until(Instant now) {
  for (; streams_ && !registers.triggered() && next_done_ <= now; next_done_ = next_done_ + period()) {
    if (!own_clock_from_ || next_done_ > *own_clock_from_) expose(next_done_);
  }
}

void IidcBus::on_pulse(std::uint64_t, Instant at) {
  const std::lock_guard lock(mutex_);
  if (!streams_) return;
  expose_until(at);
  expose(at + exposure() + kReadout);
  own_clock_from_ = at + period() * 2;
}

void IidcBus::deliver(Instant now) {
  expose_until(now);
  while (!coming_.empty() && coming_.front().done <= now) {
    const Frame frame = coming_.front();
    coming_.pop_front();
    if (silent_ || lost_.contains(frame.number) || slots_ == nullptr) continue;
    if (queue_.empty()) {
      starved_ = true;
      continue;
    }
    Slot& slot = (*slots_)[queue_.front()];
    fill(slot, frame);
    done_.push_back({queue_.front(), frame, slot.starved});
    queue_.pop_front();
  }
}

void IidcBus::fill(Slot& slot, const Frame& frame) {
  std::fill(slot.bytes.begin(), slot.bytes.end(), static_cast<std::uint8_t>(frame.number));
  const std::size_t begin = displaced_ ? slot.bytes.size() / 2 : 0;
  if (!registers.embeds()) return;
  std::size_t i = begin;
  for (const std::uint32_t number : {frame.gain | 0x8200'0000, frame.shutter | 0x8200'0000, frame.number + jumped_}) {
    for (int shift = 24; shift >= 0; shift -= 8) slot.bytes[i++] = static_cast<std::uint8_t>(number >> shift);
  }
}

void IidcBus::ignore_writes(std::uint32_t offset) {
  const std::lock_guard lock(mutex_);
  ignored_.insert(IidcRegisters::kBase + offset);
}
void IidcBus::lose(std::uint32_t frame) {
  const std::lock_guard lock(mutex_);
  lost_.insert(frame);
}
void IidcBus::tear(std::uint32_t frame) {
  const std::lock_guard lock(mutex_);
  torn_.insert(frame);
}
void IidcBus::damage(std::uint32_t frame) {
  const std::lock_guard lock(mutex_);
  damaged_.insert(frame);
}
void IidcBus::displace() {
  const std::lock_guard lock(mutex_);
  deliver(clock_.now());
  displaced_ = true;
}
void IidcBus::jump_counter(std::uint32_t by) {
  const std::lock_guard lock(mutex_);
  jumped_ += by;
}
void IidcBus::fall_silent(bool on) {
  const std::lock_guard lock(mutex_);
  silent_ = on;
}
void IidcBus::break_stream(int takes) {
  const std::lock_guard lock(mutex_);
  broken_takes_ = takes;
}
void IidcBus::refuse_buffers(int buffers) {
  const std::lock_guard lock(mutex_);
  refused_buffers_ = buffers;
}
void IidcBus::unplug() {
  const std::lock_guard lock(mutex_);
  there_ = streams_ = false;
}
void IidcBus::plug_in() {
  const std::lock_guard lock(mutex_);
  there_ = true;
  ++generation_;
}

std::uint32_t IidcBus::frames_exposed() const {
  const std::lock_guard lock(mutex_);
  return number_;
}
bool IidcBus::transmits() const {
  const std::lock_guard lock(mutex_);
  return registers.transmits();
}
bool IidcBus::triggered() const {
  const std::lock_guard lock(mutex_);
  return registers.triggered();
}
float IidcBus::shutter() const {
  const std::lock_guard lock(mutex_);
  return registers.absolute(IidcRegisters::kShutter);
}
int IidcBus::open_devices() const {
  const std::lock_guard lock(mutex_);
  return open_;
}
int IidcBus::sources() const {
  const std::lock_guard lock(mutex_);
  return sources_;
}
bool IidcBus::readable() {
  const std::lock_guard lock(mutex_);
  if (!there_ || broken_takes_ > 0) return true;
  deliver(clock_.now());
  return !done_.empty();
}

}  // namespace nodal::test
