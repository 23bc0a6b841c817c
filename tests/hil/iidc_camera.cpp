#include "iidc_camera.h"

#include <fcntl.h>
#include <linux/usb/ch9.h>
#include <pthread.h>
#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <mutex>
#include <new>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "raw_gadget.h"
#include "tests/support/iidc_registers.h"
#include "tests/support/process.h"

namespace nodal::hil {
namespace {

using State = IidcCamera::Device;
using Registers = test::IidcRegisters;
using SteadyClock = std::chrono::steady_clock;

constexpr const char* kCameraTexts[] = {"Nodal", "IIDC emulator"};
constexpr std::uint32_t kSpace = 0xF000'0000;  ///< the low half of FFFF F000 0000h
constexpr std::uint32_t kRom = 0x400;

constexpr std::uint32_t kGuidLow = 0x00C0'FFEE;  ///< low word of camera 0's GUID; the others follow
constexpr std::size_t kGuidLowPlace = 4;         ///< index of that word in the following ones

/// IEEE 1212: bus information, root directory, unit directory (IIDC 1.31), unit dependent directory, two leaves of
/// text.
constexpr std::array<std::uint32_t, 28> kConfigRom{0x0404'0000,
                                                   0x3133'3934,
                                                   0x0000'A002,
                                                   0x00B0'9D01,
                                                   kGuidLow,  // "1394", GUID
                                                   0x0003'0000,
                                                   0x0300'B09D,
                                                   0x0C00'83C0,
                                                   0xD100'0001,  // vendor; unit in 1
                                                   0x0003'0000,
                                                   0x1200'A02D,
                                                   0x1300'0102,
                                                   0xD400'0001,  // 1.31; dependent in 1
                                                   0x0003'0000,
                                                   0x4000'0000 | Registers::kBase / 4,
                                                   0x8100'0002,
                                                   0x8200'0006,  // registers, texts
                                                   0x0004'0000,
                                                   0,
                                                   0,
                                                   0x4E6F'6461,
                                                   0x6C00'0000,  // "Nodal"
                                                   0x0004'0000,
                                                   0,
                                                   0,
                                                   0x656D'756C,
                                                   0x6174'6F72,  // "emulator"
                                                   0};

Bytes camera_device() {
  return descriptor({{1, 1},
                     {0x0200, 2},
                     {0xff, 1},
                     {0, 1},
                     {0, 1},
                     {64, 1},
                     {0x1e10, 2},
                     {0x2001, 2},
                     {0x0100, 2},
                     {1, 1},
                     {2, 1},
                     {0, 1},
                     {1, 1}});
}

Bytes camera_configuration() {
  Bytes all = descriptor({{2, 1}, {0, 2}, {1, 1}, {1, 1}, {0, 1}, {0x80, 1}, {50, 1}});
  for (const Bytes& each : {descriptor({{4, 1}, {0, 1}, {0, 1}, {1, 1}, {0xff, 1}, {0, 1}, {0, 1}, {0, 1}}),
                            descriptor({{5, 1}, {RawGadget::kStream, 1}, {2, 1}, {512, 2}, {0, 1}})}) {
    all.insert(all.end(), each.begin(), each.end());
  }
  all[2] = static_cast<std::uint8_t>(all.size());
  return all;
}

class CameraProcess {
 public:
  CameraProcess(State& state, int number, const std::string& wire)
      : state_(state), usb_(number), rom_(kConfigRom), wire_(wire.empty() ? -1 : ::open(wire.c_str(), O_RDONLY)) {
    if (!wire.empty() && wire_ < 0) RawGadget::end(wire.c_str());
    rom_[kGuidLowPlace] += static_cast<std::uint32_t>(number);
    registers_.set(0x614, 0);
  }

  [[noreturn]] void run() {
    struct sigaction interrupt {};
    interrupt.sa_handler = [](int) {};  // without SA_RESTART: ends the write of a frame
    ::sigaction(SIGUSR1, &interrupt, nullptr);
    ::sigaction(SIGALRM, &interrupt, nullptr);
    std::thread sender([this] { send_frames(); });
    sender_ = sender.native_handle();
    sigset_t alarm;
    sigemptyset(&alarm);
    sigaddset(&alarm, SIGALRM);
    ::pthread_sigmask(SIG_BLOCK, &alarm, nullptr);  // it is the sender's
    for (;;) {
      const usb_ctrlrequest request = usb_.next_request();
      const bool standard = (request.bRequestType & USB_TYPE_MASK) == USB_TYPE_STANDARD;
      if (!(standard ? answer_standard(request) : answer_registers(request))) usb_.stall();
    }
  }

 private:
  bool answer_standard(const usb_ctrlrequest& request) {
    switch (request.bRequest) {
      case USB_REQ_GET_DESCRIPTOR: {
        const int kind = request.wValue >> 8;
        if (kind == USB_DT_DEVICE) return usb_.give(camera_device(), request.wLength);
        if (kind == USB_DT_CONFIG) return usb_.give(camera_configuration(), request.wLength);
        if (kind != USB_DT_STRING) return false;
        return usb_.give(string_descriptor(request.wValue & 0xff, kCameraTexts), request.wLength);
      }
      case USB_REQ_SET_CONFIGURATION: usb_.configure(); return true;
      default: return false;
    }
  }

  /// Numbers of four bytes from an address, in requests of the maker.
  bool answer_registers(const usb_ctrlrequest& request) {
    if (request.bRequest != 0x7f || request.wLength % 4 != 0) return false;
    const std::uint32_t offset = (std::uint32_t{request.wIndex} << 16 | request.wValue) - kSpace;
    if ((request.bRequestType & USB_DIR_IN) != 0) {
      Bytes bytes;
      for (std::uint32_t i = 0; i < request.wLength; i += 4) {
        std::uint32_t value = 0;
        if (!read(offset + i, value)) return false;
        put(bytes, value, 4);
      }
      return usb_.give(bytes, request.wLength);
    }
    if (state_.refuse) return false;
    if (state_.answer_after_us > 0) ::usleep(state_.answer_after_us);
    const Bytes bytes = usb_.take(request.wLength);
    for (std::uint32_t i = 0; i + 4 <= bytes.size(); i += 4) {
      std::uint32_t value = 0;
      std::memcpy(&value, bytes.data() + i, 4);
      write(offset + i, value);
    }
    return true;
  }

  bool read(std::uint32_t offset, std::uint32_t& value) {
    if (offset >= kRom && offset < kRom + 4 * rom_.size()) {
      value = rom_[(offset - kRom) / 4];
      return true;
    }
    const std::lock_guard lock(mutex_);
    return registers_.read(offset, value);
  }

  void write(std::uint32_t offset, std::uint32_t value) {
    const std::lock_guard lock(mutex_);
    registers_.write(offset, value);
    changes_.push_back({SteadyClock::now(), registers_.get(0x81C) & 0xFFF, registers_.get(0x820) & 0xFFF});
    state_.shutter = registers_.absolute(Registers::kShutter);
    state_.gain = registers_.absolute(Registers::kGain);
    state_.trigger = registers_.get(0x830);
    if (registers_.transmits() && !state_.transmits) {
      shutter_ = changes_.back().shutter;
      gain_ = changes_.back().gain;
      changes_.clear();
      start_ = SteadyClock::now();
      number_ = 0;
      phase_ = Phase::kIdle;
    }
    const bool ends = state_.transmits && !registers_.transmits();
    state_.transmits = registers_.transmits();
    if (ends) ::pthread_kill(sender_, SIGUSR1);
  }

  struct Change {
    SteadyClock::time_point at;
    std::uint32_t shutter, gain;
    int frames_left = 2;
  };

  /// The next frame of a stream, if its time has come.
  bool next_frame(Bytes& frame) {
    const std::lock_guard lock(mutex_);
    const bool pulse = pulse_begins();
    if (!state_.transmits) return false;
    const SteadyClock::time_point now = SteadyClock::now();
    SteadyClock::time_point begun = now - std::chrono::microseconds(kReadoutUs + 10 * shutter_);
    if (registers_.triggered()) {
      if (!exposed_by_pulse(now, pulse)) return false;
      begun = pulse_at_;
    } else {
      const double periods = std::chrono::duration<double>(now - start_).count() * registers_.hertz();
      if (periods < number_ + 1) return false;
      number_ = static_cast<std::uint32_t>(periods);  // those that nobody took are lost
    }
    for (Change& change : changes_) change.frames_left -= begun < change.at ? 0 : 1;
    for (; !changes_.empty() && changes_.front().frames_left < 0; changes_.pop_front()) {
      shutter_ = changes_.front().shutter;
      gain_ = changes_.front().gain;
    }
    frame.assign(registers_.picture_bytes(), static_cast<std::uint8_t>(shutter_));
    std::fill(frame.end() - static_cast<std::ptrdiff_t>(frame.size() / registers_.height()), frame.end(),
              static_cast<std::uint8_t>(number_));
    if (!registers_.embeds()) return true;
    std::size_t i = 0;
    for (const std::uint32_t each : {gain_ | 0x8200'0000, shutter_ | 0x8200'0000, number_}) {
      for (int shift = 24; shift >= 0; shift -= 8) frame[i++] = static_cast<std::uint8_t>(each >> shift);
    }
    return true;
  }

  /// Whether a picture that a pulse started has been read out.
  bool exposed_by_pulse(SteadyClock::time_point now, bool pulse) {
    const bool by_pulse = (registers_.get(0x830) >> 16 & 0xF) == 1;
    if (phase_ == Phase::kIdle && pulse) {
      phase_ = Phase::kExposes;
      pulse_at_ = now;
      number_ = input_pulses_;
    }
    if (phase_ == Phase::kExposes &&
        (by_pulse ? !high_ : now >= pulse_at_ + std::chrono::microseconds(10 * shutter_))) {
      phase_ = Phase::kReadsOut;
      exposed_at_ = by_pulse ? now : pulse_at_ + std::chrono::microseconds(10 * shutter_);
    }
    if (phase_ != Phase::kReadsOut || now < exposed_at_ + std::chrono::microseconds(kReadoutUs)) return false;
    phase_ = Phase::kIdle;
    return true;
  }

  /// Samples the trigger input.
  bool pulse_begins() {
    char text = '0';
    const bool was_high = std::exchange(high_, wire_ >= 0 && ::pread(wire_, &text, 1, 0) == 1 && text == '1');
    const bool by_wire = high_ && !was_high;
    const bool by_test = state_.pulses != std::exchange(pulses_, state_.pulses);
    if (by_wire || by_test) ++input_pulses_;
    return by_wire || by_test;
  }

  void send_frames() {
    for (Bytes frame;;) {
      std::this_thread::sleep_for(std::chrono::microseconds(500));
      if (!next_frame(frame) || state_.silent || state_.skip.exchange(false)) continue;
      if (state_.tear.exchange(false)) frame.resize(frame.size() / 2);
      std::size_t at = 0;
      give_up_after(50'000);  // a frame that nobody takes
      while (at < frame.size() && state_.transmits) {
        const std::size_t n = std::min<std::size_t>(frame.size() - at, RawGadget::kMaxBytes);
        if (usb_.write(std::span(frame).subspan(at, n)) != 0) break;
        at += n;
      }
      give_up_after(0);
      if (at == frame.size()) ++state_.sent;
    }
  }

  /// Interrupts the sender's calls at this interval; 0: never.
  static void give_up_after(int us) {
    const itimerval every{{0, us}, {0, us}};
    ::setitimer(ITIMER_REAL, &every, nullptr);
  }

  static constexpr std::int64_t kReadoutUs = IidcCamera::kReadout.us();
  enum class Phase : std::uint8_t { kIdle, kExposes, kReadsOut };

  State& state_;
  RawGadget usb_;
  std::array<std::uint32_t, kConfigRom.size()> rom_;
  const int wire_;
  pthread_t sender_{};
  std::mutex mutex_;  ///< protects the following members
  Registers registers_;
  std::deque<Change> changes_;
  SteadyClock::time_point start_;
  std::uint32_t number_ = 0, pulses_ = 0, input_pulses_ = 0, shutter_ = 0, gain_ = 0;
  Phase phase_ = Phase::kIdle;
  bool high_ = true;
  SteadyClock::time_point pulse_at_, exposed_at_;
};

/// Whether the kernel has the camera, and libusb can open it.
bool is_plugged_in(int number) {
  std::error_code gone;  // while it is listed
  const std::string controller = "/dummy_hcd." + std::to_string(number) + "/";
  for (const auto& device : std::filesystem::directory_iterator("/sys/bus/usb/devices")) {
    std::string vendor;
    std::ifstream(device.path() / "idVendor") >> vendor;
    if (vendor != "1e10" ||
        std::filesystem::canonical(device.path(), gone).string().find(controller) == std::string::npos)
      continue;
    return std::filesystem::exists(device.path() / "bConfigurationValue");
  }
  return false;
}

}  // namespace

hal::iidc::HeadRequest IidcCamera::request() {
  hal::iidc::HeadRequest request;
  request.pixels = PixelFormat::kGrey8;
  request.rate = {30, 1};
  request.width = 48;
  request.height = 32;
  request.readout = kReadout;
  return request;
}

std::string IidcCamera::path() const {
  std::ostringstream text;
  text << "iidc:00b09d01" << std::hex << std::setfill('0') << std::setw(8)
       << kGuidLow + static_cast<std::uint32_t>(number_);
  return text.str();
}

IidcCamera::IidcCamera(int number, std::string wire)
    : number_(number), device_(new (shared_memory(sizeof(Device))) Device) {
  process_ = start_process([this, &wire] { CameraProcess(*device_, number_, wire).run(); });
  if (!test::wait_until([this] { return is_plugged_in(number_); }, std::chrono::seconds(20)))
    throw std::runtime_error("the kernel did not find the camera");
}

void IidcCamera::unplug() {
  if (process_ < 0) return;
  kill_process(std::exchange(process_, -1));
  if (!test::wait_until([this] { return !is_plugged_in(number_); }, std::chrono::seconds(20))) std::abort();
}

}  // namespace nodal::hil
