#include "firmware/daemon/rig_proposal.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>

#include "protocol/files/user_folder.h"

namespace nodal::daemon {
namespace {

using hal::v4l2::FoundDevice;
using hal::v4l2::FoundSize;

constexpr std::int64_t kLargeArea = 1920 * 1080;  ///< what a board blends from ten heads; RIG.md names larger sizes
constexpr double kUsualRate = 30;
constexpr double kSameRate = 1e-3;  ///< the same tolerance as when a device is opened

/// The formats of raymaps, in order of preference.
constexpr std::array kFamilies{PixelFormat::kI420, PixelFormat::kRgb24, PixelFormat::kGrey8};

struct Mode {
  PixelFormat format;
  int width, height;
  std::int64_t bytes_per_second;
  std::int64_t area() const { return std::int64_t{width} * height; }
};

double hertz(FrameRate rate) { return static_cast<double>(rate.numerator) / rate.denominator; }

bool delivers(const FoundSize& size, FrameRate rate) {
  if (size.rates.empty()) return true;
  const double wanted = hertz(rate);
  if (size.rate_range) {
    return wanted <= hertz(size.rates.front()) * (1 + kSameRate) &&
           wanted >= hertz(size.rates.back()) * (1 - kSameRate);
  }
  return std::any_of(size.rates.begin(), size.rates.end(),
                     [&](FrameRate one) { return std::abs(hertz(one) / wanted - 1) < kSameRate; });
}

std::int64_t bytes_per_second(PixelFormat format, const FoundSize& size, FrameRate rate) {
  const auto pixels = std::int64_t{size.width} * size.height;
  // What cameras make of a picture as a JPEG; two bits a pixel is a high quality.
  const std::int64_t bytes = format == PixelFormat::kMjpeg
                                 ? pixels / 4
                                 : static_cast<std::int64_t>(packed_size(format, size.width, size.height));
  return bytes * rate.numerator / rate.denominator;
}

/// What a device can do at this rate, best first.
std::vector<Mode> modes_of(const FoundDevice& device, PixelFormat family, FrameRate rate) {
  std::vector<Mode> modes;
  for (const auto& format : device.formats) {
    if (!format.pixels || !blended_format(*format.pixels, family)) continue;
    for (const FoundSize& size : format.sizes) {
      const bool blendable = size.width % 2 == 0 && size.height % 4 == 0;
      if (!blendable || !delivers(size, rate)) continue;
      const std::int64_t bytes = bytes_per_second(*format.pixels, size, rate);
      if (device.usb && bytes > hal::device::usb_capacity(device.usb->device_mbit)) continue;
      modes.push_back({*format.pixels, size.width, size.height, bytes});
    }
  }
  std::stable_sort(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) {
    const auto rank = [](const Mode& mode) {
      const bool large = mode.area() > kLargeArea;
      // If sizes are equal, prefers the one that needs no decoding.
      const bool decoded = mode.format == PixelFormat::kMjpeg || is_bayer(mode.format);
      return std::tuple(large, large ? mode.area() : -mode.area(), decoded, mode.bytes_per_second);
    };
    return rank(a) < rank(b);
  });
  return modes;
}

bool can_be_head(const FoundDevice& device) { return !device.problem && !device.second_stream; }

std::vector<FrameRate> rates_of(const std::vector<FoundDevice>& devices) {
  std::vector<FrameRate> all;
  for (const FoundDevice& device : devices) {
    for (const auto& format : device.formats) {
      for (const FoundSize& size : format.sizes) {
        all.insert(all.end(), size.rates.begin(), size.rates.end());
        if (size.rate_range || size.rates.empty()) all.push_back({30, 1});
      }
    }
  }
  // Nearest to the usual rate first; ratios, so that 15 and 60 are equally far.
  const auto distance = [](FrameRate rate) { return std::abs(std::log(hertz(rate) / kUsualRate)); };
  std::stable_sort(all.begin(), all.end(), [&](FrameRate a, FrameRate b) { return distance(a) < distance(b); });
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

struct Choice {
  PixelFormat family = PixelFormat::kI420;
  FrameRate rate;
  int heads = 0;
};
Choice choose(const std::vector<FoundDevice>& devices) {
  Choice best;
  const std::vector<FrameRate> rates = rates_of(devices);
  for (const PixelFormat family : kFamilies) {
    for (const FrameRate rate : rates) {
      const auto heads = std::count_if(devices.begin(), devices.end(), [&](const FoundDevice& device) {
        return can_be_head(device) && !modes_of(device, family, rate).empty();
      });
      if (heads > best.heads) best = {family, rate, static_cast<int>(heads)};
    }
  }
  return best;
}

struct Candidate {
  std::size_t device;
  std::vector<Mode> modes;
  std::size_t mode = 0;
  const Mode& now() const { return modes[mode]; }
};

/// Takes smaller sizes until every bus carries its heads, and leaves out heads that have none.
void fit_buses(const std::vector<FoundDevice>& devices, std::vector<Candidate>& heads, RigProposal& proposal) {
  for (;;) {
    std::map<int, std::int64_t> load;
    for (const Candidate& head : heads) {
      if (const auto& usb = devices[head.device].usb) load[usb->bus] += head.now().bytes_per_second;
    }
    const auto too_much = [&](const Candidate& head) {
      const auto& usb = devices[head.device].usb;
      const std::int64_t capacity = usb ? hal::device::usb_capacity(usb->bus_mbit) : 0;
      return capacity > 0 && load[usb->bus] > capacity;
    };
    auto largest = heads.end();
    for (auto head = heads.begin(); head != heads.end(); ++head) {
      if (!too_much(*head)) continue;
      if (largest == heads.end() || head->now().bytes_per_second >= largest->now().bytes_per_second) largest = head;
    }
    if (largest == heads.end()) return;
    const auto next = std::find_if(largest->modes.begin(), largest->modes.end(), [&](const Mode& mode) {
      return mode.bytes_per_second < largest->now().bytes_per_second && mode.area() <= largest->now().area();
    });
    if (next != largest->modes.end()) {
      largest->mode = static_cast<std::size_t>(next - largest->modes.begin());
      continue;
    }
    proposal.left_out[largest->device] =
        fmt::format("USB bus {} cannot carry it beside the other heads; plug it into another bus",
                    devices[largest->device].usb->bus);
    heads.erase(largest);
  }
}

std::string why_not(const FoundDevice& device) {
  if (device.problem) return device.problem->message;
  if (device.second_stream) return "another stream of the same camera";
  if (!device.listed_only.empty()) return device.listed_only;
  return "it has no format and size of a head at the rate of the others";
}

/// A basic string of TOML; text of devices is printable already.
std::string quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace

RigProposal propose_rig(const std::vector<FoundDevice>& devices) {
  RigProposal proposal;
  const Choice choice = choose(devices);
  std::vector<Candidate> heads;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    std::vector<Mode> modes;
    if (choice.heads > 0 && can_be_head(devices[i])) modes = modes_of(devices[i], choice.family, choice.rate);
    if (modes.empty()) {
      proposal.left_out[i] = why_not(devices[i]);
    } else if (heads.size() == kMaxHeads) {
      proposal.left_out[i] = fmt::format("a rig has at most {} heads", kMaxHeads);
    } else {
      heads.push_back({i, std::move(modes)});
    }
  }
  if (choice.heads == 0) return proposal;
  proposal.rate = choice.rate;
  proposal.raymap_format = choice.family;
  fit_buses(devices, heads, proposal);
  for (const Candidate& head : heads) {
    const Mode& mode = head.now();
    proposal.heads.push_back({head.device, fmt::format("cam{}", proposal.heads.size()), mode.format, mode.width,
                              mode.height, mode.bytes_per_second});
  }
  return proposal;
}

RigPlaces places_of_this_user() {
  if (::geteuid() == 0) return {};
  return {user_rig_socket(), user_rig_folder()};
}

std::string rig_toml(const RigProposal& proposal, const std::vector<FoundDevice>& devices, const RigPlaces& places) {
  std::string text = fmt::format(
      "[rig]\nname = \"rig\"\nrate = \"{}/{}\"\n\n[raymap]\nformat = \"{}\"\n\n"
      "[trigger]\nsource = \"none\"      # V4L2 devices run free\n",
      proposal.rate.numerator, proposal.rate.denominator, pixel_format_name(proposal.raymap_format));
  if (!places.socket.empty()) text += fmt::format("\n[links]\nunix = {}\n", quoted(places.socket));
  if (!places.folder.empty()) text += fmt::format("\n[store]\nfolder = {}\n", quoted(places.folder));
  text += fmt::format("\n# Without these two lines the rig records nothing.\n# [takes]\n# folder = {}\n",
                      quoted((places.folder.empty() ? "/var/lib/nodal" : places.folder) + "/takes"));
  for (const ProposedHead& head : proposal.heads) {
    const FoundDevice& device = devices[head.device];
    text += fmt::format("\n[[heads]]\nname = \"{}\"\nport = {}\nformat = \"{}\"\nsize = \"{}x{}\"\n", head.name,
                        quoted(device.port), pixel_format_name(head.format), head.width, head.height);
    if (device.fields != Fields::kProgressive) {
      text += fmt::format("fields = \"{}\"\n", fields_name(device.fields));
    }
  }
  return text;
}

std::string rate_text(FrameRate rate) {
  return rate.denominator == 1 ? fmt::format("{}", rate.numerator)
                               : fmt::format("{}/{}", rate.numerator, rate.denominator);
}

}  // namespace nodal::daemon
