#include "firmware/daemon/scan_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "firmware/config/written_toml.h"
#include "firmware/daemon/rig_proposal.h"
#include "protocol/base/try.h"

namespace nodal::daemon {
namespace {

using hal::device::megabytes;
using hal::device::usb_capacity;
using hal::v4l2::FoundControl;
using hal::v4l2::FoundDevice;
using hal::v4l2::FoundFormat;
using hal::v4l2::FoundSize;
using Json = nlohmann::json;

constexpr std::size_t kSizesShown = 16, kRatesShown = 8;  ///< limits of the text report; the JSON has all

std::string size_text(const FoundSize& size) {
  std::string text = fmt::format("{}x{}", size.width, size.height);
  if (size.rates.empty()) return text;
  text += " at ";
  for (std::size_t i = 0; i < std::min(size.rates.size(), kRatesShown); ++i) {
    if (i > 0) text += size.rate_range ? " to " : " ";
    text += rate_text(size.rates[i]);
  }
  if (size.rates.size() > kRatesShown) text += fmt::format(" and {} more", size.rates.size() - kRatesShown);
  return text;
}

std::string sizes_text(const FoundFormat& format) {
  std::string text;
  for (std::size_t i = 0; i < std::min(format.sizes.size(), kSizesShown); ++i) {
    text += (i == 0 ? "" : "; ") + size_text(format.sizes[i]);
  }
  if (format.sizes.size() > kSizesShown) text += fmt::format("; and {} more", format.sizes.size() - kSizesShown);
  return text + (format.size_range ? "; and sizes between" : "");
}

/// One line for all formats with the same sizes, and one for those that heads cannot have.
std::vector<std::string> format_lines(const FoundDevice& device) {
  std::vector<std::pair<std::string, std::string>> groups;  // names, sizes
  std::string others;
  for (const FoundFormat& format : device.formats) {
    if (!format.pixels) {
      others += (others.empty() ? "" : ", ") + format.name;
      continue;
    }
    std::string sizes = sizes_text(format);
    const auto group = std::find_if(groups.begin(), groups.end(), [&](const auto& one) { return one.second == sizes; });
    if (group == groups.end()) groups.emplace_back(format.name, std::move(sizes));
    else group->first += ", " + format.name;
  }
  std::vector<std::string> lines;
  for (const auto& [names, sizes] : groups) lines.push_back(names + ": " + sizes);
  if (!others.empty()) lines.push_back("not for heads: " + others);
  return lines;
}

std::string control_text(const FoundControl& control) {
  return fmt::format("{}: {} to {} in steps of {}, default {}", control.name, control.low, control.high, control.step,
                     control.usual);
}

struct Bus {
  int mbit = 0;
  std::int64_t used = 0;
};
std::map<int, Bus> buses_of(const std::vector<FoundDevice>& devices, const RigProposal& proposal) {
  std::map<int, Bus> buses;
  for (const FoundDevice& device : devices) {
    if (device.usb) buses[device.usb->bus].mbit = device.usb->bus_mbit;
  }
  for (const ProposedHead& head : proposal.heads) {
    if (const auto& usb = devices[head.device].usb) buses[usb->bus].used += head.bytes_per_second;
  }
  return buses;
}

const ProposedHead* head_of(const RigProposal& proposal, std::size_t device) {
  const auto head = std::find_if(proposal.heads.begin(), proposal.heads.end(),
                                 [&](const ProposedHead& one) { return one.device == device; });
  return head == proposal.heads.end() ? nullptr : &*head;
}

void add_device(std::string& text, const FoundDevice& device, const ProposedHead* head, const std::string& left_out) {
  const auto line = [&](const std::string& what) { text += "#   " + what + "\n"; };
  text += fmt::format("# {}: {}\n", device.node, device.model.empty() ? "unknown" : device.model);
  line(device.port + (device.driver.empty() ? "" : ", driver " + device.driver));
  if (device.usb) {
    line(fmt::format("USB bus {}, {} Mbit/s", device.usb->bus, device.usb->device_mbit) +
         (device.usb->serial.empty() ? "" : ", serial " + device.usb->serial));
  }
  if (!device.input.empty()) {
    line("input " + device.input + (device.standard ? ", a standard of " + rate_text(*device.standard) : ""));
  }
  for (const std::string& formats : format_lines(device)) line(formats);
  for (const FoundControl& control : device.controls) line(control_text(control));
  for (const std::string& oddity : device.oddities) line("odd: the driver " + oddity);
  if (head == nullptr) return line("not in this rig: " + left_out);
  line(fmt::format("{} below: {} MB/s", head->name, megabytes(head->bytes_per_second)));
}

Json size_json(const FoundSize& size) {
  Json rates = Json::array();
  for (const FrameRate rate : size.rates) rates.push_back(fmt::format("{}/{}", rate.numerator, rate.denominator));
  return {{"width", size.width}, {"height", size.height}, {"rates", rates}, {"rate_range", size.rate_range}};
}

Json format_json(const FoundFormat& format) {
  Json sizes = Json::array();
  for (const FoundSize& size : format.sizes) sizes.push_back(size_json(size));
  return {{"name", format.name},
          {"format", format.pixels ? Json(pixel_format_name(*format.pixels)) : Json()},
          {"sizes", sizes},
          {"size_range", format.size_range}};
}

Json device_json(const FoundDevice& device) {
  Json json{{"node", device.node},     {"port", device.port},        {"model", device.model},
            {"driver", device.driver}, {"input", device.input},      {"formats", Json::array()},
            {"usb", nullptr},          {"standard", nullptr},        {"controls", Json::array()},
            {"problem", nullptr},      {"oddities", device.oddities}};
  if (device.usb) {
    json["usb"] = {{"bus", device.usb->bus},
                   {"bus_mbit", device.usb->bus_mbit},
                   {"device_mbit", device.usb->device_mbit},
                   {"serial", device.usb->serial}};
  }
  if (device.standard)
    json["standard"] = fmt::format("{}/{}", device.standard->numerator, device.standard->denominator);
  if (device.problem) json["problem"] = device.problem->message;
  for (const FoundFormat& format : device.formats) json["formats"].push_back(format_json(format));
  for (const FoundControl& control : device.controls) {
    json["controls"].push_back({{"name", control.name},
                                {"low", control.low},
                                {"high", control.high},
                                {"step", control.step},
                                {"default", control.usual}});
  }
  return json;
}

/// nodald refuses a rig.toml without heads, so there is nothing to read back in one.
Status read_back(const std::string& toml, const RigProposal& proposal, const std::vector<FoundDevice>& devices) {
  if (proposal.heads.empty()) return {};
  std::vector<firmware::WrittenHead> heads;
  for (const ProposedHead& head : proposal.heads) heads.push_back({head.name, devices[head.device].port});
  return firmware::check_written_toml(toml, "the proposed rig.toml", heads);
}

}  // namespace

Result<std::string> scan_text(const std::vector<FoundDevice>& devices, const RigPlaces& places) {
  const RigProposal proposal = propose_rig(devices);
  std::string text =
      "# The V4L2 devices and IIDC cameras of this machine, and a rig.toml for the V4L2 devices (nodald --scan).\n"
      "# `nodald --explain KEY` explains a key, such as heads.port; RIG.md explains all of them.\n";
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const auto left_out = proposal.left_out.find(i);
    add_device(text, devices[i], head_of(proposal, i), left_out == proposal.left_out.end() ? "" : left_out->second);
  }
  for (const auto& [number, bus] : buses_of(devices, proposal)) {
    text += fmt::format("# USB bus {} ({} Mbit/s): {} MB/s of at most {}\n", number, bus.mbit, megabytes(bus.used),
                        megabytes(usb_capacity(bus.mbit)));
  }
  if (devices.empty())
    text += "# There is none. Plug one in; `ls /dev/video*` shows whether the kernel knows a V4L2 device.\n";
  text += "\n" + rig_toml(proposal, devices, places);
  NODAL_TRY(read_back(text, proposal, devices));
  return text;
}

Result<std::string> scan_json(const std::vector<FoundDevice>& devices, const RigPlaces& places) {
  const RigProposal proposal = propose_rig(devices);
  const std::string toml = rig_toml(proposal, devices, places);
  NODAL_TRY(read_back(toml, proposal, devices));
  Json all{{"devices", Json::array()}, {"buses", Json::array()}, {"rig_toml", toml}};
  for (std::size_t i = 0; i < devices.size(); ++i) {
    Json device = device_json(devices[i]);
    const auto left_out = proposal.left_out.find(i);
    device["left_out"] = left_out == proposal.left_out.end() ? Json() : Json(left_out->second);
    const ProposedHead* const head = head_of(proposal, i);
    device["head"] = head == nullptr ? Json()
                                     : Json{{"name", head->name},
                                            {"format", pixel_format_name(head->format)},
                                            {"width", head->width},
                                            {"height", head->height},
                                            {"bytes_per_second", head->bytes_per_second}};
    all["devices"].push_back(std::move(device));
  }
  for (const auto& [number, bus] : buses_of(devices, proposal)) {
    all["buses"].push_back(
        {{"bus", number}, {"mbit", bus.mbit}, {"used", bus.used}, {"capacity", usb_capacity(bus.mbit)}});
  }
  return all.dump();
}

}  // namespace nodal::daemon
