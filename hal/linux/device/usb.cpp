#include "hal/linux/device/usb.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <list>
#include <string_view>

#include "protocol/base/text.h"
#include "protocol/files/open_file.h"

namespace nodal::hal::device {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestAttribute = 256;
constexpr int kMaxLevels = 4;  ///< from a video device to its USB device: the interface, and drivers between them

/// The first line of a file of sysfs, or nothing.
std::optional<std::string> attribute(const fs::path& file) {
  const Result<FilePtr> in = open_to_read(file);
  std::array<char, kLongestAttribute> text{};
  const std::size_t got = in ? std::fread(text.data(), 1, text.size(), in->get()) : 0;
  if (got == 0) return std::nullopt;
  const std::string_view all(text.data(), got);
  return std::string(all.substr(0, all.find('\n')));
}

/// Whole numbers; "1.5", the speed of mice, is 1.
int number(const std::optional<std::string>& text) {
  int value = 0;
  if (text) std::from_chars(text->data(), text->data() + text->size(), value);
  return value;
}

/// Place of the USB device that has this folder in sysfs.
UsbPlace place_in(const fs::path& sysfs, const fs::path& device) {
  UsbPlace place;
  place.bus = number(attribute(device / "busnum"));
  place.device_mbit = number(attribute(device / "speed"));
  place.bus_mbit = number(attribute(sysfs / "bus" / "usb" / "devices" / fmt::format("usb{}", place.bus) / "speed"));
  place.serial = printable(attribute(device / "serial").value_or(""), kLongestAttribute);
  return place;
}

}  // namespace

std::optional<UsbPlace> usb_place_of(const fs::path& sysfs, const std::string& node) {
  std::error_code error;
  const fs::path device = fs::canonical(node, error);  // names in /dev/v4l are links to nodes
  const std::string name = (error ? fs::path(node) : device).filename().string();
  fs::path at = fs::canonical(sysfs / "class" / "video4linux" / name / "device", error);
  if (error) return std::nullopt;
  for (int level = 0; level < kMaxLevels && at.has_relative_path(); ++level, at = at.parent_path()) {
    if (fs::exists(at / "busnum", error) && fs::exists(at / "speed", error)) return place_in(sysfs, at);
  }
  return std::nullopt;
}

std::optional<UsbPlace> usb_place_at(const fs::path& sysfs, int bus, int address) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(sysfs / "bus" / "usb" / "devices", error)) {
    const bool is_it =
        number(attribute(entry.path() / "busnum")) == bus && number(attribute(entry.path() / "devnum")) == address;
    if (is_it && fs::exists(entry.path() / "speed", error)) return place_in(sysfs, entry.path());
  }
  return std::nullopt;
}

std::int64_t usb_capacity(int mbit) {
  if (mbit >= 10'000) return std::int64_t{mbit} * 1'000'000 / 8 * 128 / 132;
  if (mbit >= 5'000) return std::int64_t{mbit} * 1'000'000 / 10;
  if (mbit >= 480) return 13 * 512 * 8000;
  if (mbit >= 12) return 19 * 64 * 1000;
  return 0;
}

std::string megabytes(std::int64_t bytes) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", static_cast<double>(bytes) / 1e6);
  return text.data();
}

struct UsbBuses::Ledger {
  struct Entry {
    int bus;
    std::int64_t bytes;
    std::string text;
  };
  std::mutex mutex;
  std::list<Entry> entries;
};

std::shared_ptr<UsbBuses::Ledger> UsbBuses::make() { return std::make_shared<Ledger>(); }

Result<UsbBuses::Share> UsbBuses::claim(const UsbPlace& place, std::int64_t bytes_per_second, const std::string& who,
                                        const std::string& what) {
  const std::string mine = what + ", " + megabytes(bytes_per_second) + " MB/s";
  const auto refuse = [&](const std::string& carrier, std::int64_t capacity, const std::string& others) {
    return fail(Errc::kBandwidth, "head '" + who + "': " + mine + ": " + carrier + " carries at most " +
                                      megabytes(capacity) + " MB/s" + others +
                                      "; choose a smaller size or a lower rate, or plug it into another bus");
  };
  const std::int64_t own = usb_capacity(place.device_mbit);
  if (own > 0 && bytes_per_second > own) {
    return refuse(fmt::format("its connection (USB, {} Mbit/s)", place.device_mbit), own, "");
  }
  const std::int64_t capacity = usb_capacity(place.bus_mbit);
  const std::lock_guard lock(ledger_->mutex);
  std::int64_t used = 0;
  std::string others;
  for (const Ledger::Entry& entry : ledger_->entries) {
    if (entry.bus != place.bus) continue;
    used += entry.bytes;
    others += (others.empty() ? "" : "; ") + entry.text;
  }
  if (capacity > 0 && used + bytes_per_second > capacity) {
    return refuse(fmt::format("USB bus {} ({} Mbit/s)", place.bus, place.bus_mbit), capacity,
                  others.empty() ? "" : ", and " + megabytes(used) + " MB/s are in use (" + others + ")");
  }
  const auto entry = ledger_->entries.insert(ledger_->entries.end(), {place.bus, bytes_per_second, who + ": " + mine});
  return Share(entry->text.data(), [ledger = ledger_, entry](const void*) {
    const std::lock_guard relock(ledger->mutex);
    ledger->entries.erase(entry);
  });
}

}  // namespace nodal::hal::device
