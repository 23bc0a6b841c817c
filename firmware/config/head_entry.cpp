#include "firmware/config/head_entry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "firmware/config/gpio_entry.h"
#include "protocol/base/limits.h"

namespace nodal::firmware {
namespace {

struct Scheme {
  PortKind kind;
  std::string_view name;
};
constexpr std::array kSchemes{Scheme{PortKind::kSim, "sim"}, Scheme{PortKind::kReplay, "replay"},
                              Scheme{PortKind::kTake, "take"}, Scheme{PortKind::kV4l2, "v4l2"},
                              Scheme{PortKind::kIidc, "iidc"}};

std::string_view scheme_of(PortKind kind) { return std::ranges::find(kSchemes, kind, &Scheme::kind)->name; }

bool is_name(std::string_view text) {
  return !text.empty() && text.size() <= 64 && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  });
}

PortAddress read_port(TomlReader& reader) {
  const std::string port = reader.required_text("port");
  const std::size_t colon = port.find(':');
  PortAddress address;
  address.name = colon == std::string::npos ? "" : port.substr(colon + 1);
  bool known = false;
  for (const Scheme& scheme : kSchemes) {
    if (port.substr(0, colon) != scheme.name) continue;
    address.kind = scheme.kind;
    known = true;
  }
  if (!port.empty() && (!known || address.name.empty())) {
    reader.refuse("port", "must be sim:NAME, replay:FILE, replay:GLOB, take:FOLDER/HEAD, v4l2:DEVICE or iidc:GUID");
  }
  return address;
}

constexpr std::uint32_t kLargestSide = 16384;

/// "720x480".
void read_size(TomlReader& reader, DeviceConfig& device) {
  const std::string size = reader.text("size", "");
  if (!reader.has("size")) return;
  const std::size_t cross = size.find('x');
  const auto width = parse_whole(std::string_view(size).substr(0, cross));
  const auto height = cross == std::string::npos ? std::nullopt : parse_whole(std::string_view(size).substr(cross + 1));
  if (!width || !height || *width > kLargestSide || *height > kLargestSide) {
    return reader.refuse("size", fmt::format("must be WIDTHxHEIGHT such as \"720x480\", each 1 to {}", kLargestSide));
  }
  device.width = static_cast<int>(*width);
  device.height = static_cast<int>(*height);
}

void read_device(TomlReader& reader, PortKind kind, FrameRate rate, DeviceConfig& device) {
  for (const char* const key : {"size", "gain_step_mdb", "readout_us"}) {
    if (kind == PortKind::kV4l2 || kind == PortKind::kIidc || !reader.has(key)) continue;
    return reader.refuse(key, "is only allowed for v4l2: and iidc: ports");
  }
  for (const char* const key : {"input", "standard", "separate_fields"}) {
    if (kind == PortKind::kV4l2 || !reader.has(key)) continue;
    return reader.refuse(key, "is only allowed for v4l2: ports");
  }
  for (const char* const key : {"left", "top", "packet_bytes", "exposure_by"}) {
    if (kind == PortKind::kIidc || !reader.has(key)) continue;
    return reader.refuse(key, "is only allowed for iidc: ports");
  }
  read_size(reader, device);
  device.separate_fields = reader.boolean("separate_fields", false);
  device.input = reader.text("input", "");
  device.standard = reader.text("standard", "");
  device.gain_step_mdb = static_cast<std::int32_t>(reader.integer("gain_step_mdb", 1, kMaxGainMdb, 0));
  if (reader.has("readout_us")) {
    device.readout = Duration::microseconds(reader.integer("readout_us", 0, 10 * rate.period().us(), 0));
  }
  if (reader.has("left") != reader.has("top")) {
    return reader.refuse(reader.has("left") ? "top" : "left", "is missing; a rectangle of the sensor needs both",
                         Errc::kMissingField);
  }
  if (reader.has("left")) {
    device.left = static_cast<int>(reader.integer("left", 0, kLargestSide, 0));
    device.top = static_cast<int>(reader.integer("top", 0, kLargestSide, 0));
  }
  device.packet_bytes = static_cast<std::uint32_t>(reader.integer("packet_bytes", 4, 65535, 0));
  device.pulse_is_exposure = reader.choice<bool>("exposure_by", {{"shutter", false}, {"pulse", true}});
}

void check_iidc(TomlReader& reader, const HeadConfig& head) {
  const PixelFormat format = head.format;
  const bool there_is = is_bayer(format) || format == PixelFormat::kGrey8 || format == PixelFormat::kUyvy ||
                        format == PixelFormat::kYuv411 || format == PixelFormat::kRgb24;
  if (!there_is) {
    reader.refuse("format", "cannot be " + std::string(pixel_format_name(format)) +
                                " for iidc: ports; IIDC cameras have GREY, UYVY, YUV411, RGB24 and Bayer formats");
  }
}

}  // namespace

HeadConfig read_head(TomlReader& reader, FrameRate rate) {
  HeadConfig head;
  head.line = reader.line();
  head.name = read_name(reader);
  head.port = read_port(reader);
  head.format = reader.choice<PixelFormat>("format", {{"I420", PixelFormat::kI420},
                                                      {"NV12", PixelFormat::kNv12},
                                                      {"YUYV", PixelFormat::kYuyv},
                                                      {"UYVY", PixelFormat::kUyvy},
                                                      {"I422", PixelFormat::kI422},
                                                      {"RGB24", PixelFormat::kRgb24},
                                                      {"GREY", PixelFormat::kGrey8},
                                                      {"MJPEG", PixelFormat::kMjpeg},
                                                      {"RGGB8", PixelFormat::kRggb8},
                                                      {"GRBG8", PixelFormat::kGrbg8},
                                                      {"GBRG8", PixelFormat::kGbrg8},
                                                      {"BGGR8", PixelFormat::kBggr8},
                                                      {"YUV411", PixelFormat::kYuv411}});
  const bool not_made = is_bayer(head.format) || head.format == PixelFormat::kYuv411;
  if (not_made && head.port.kind == PortKind::kReplay) {
    reader.refuse("format", "cannot be " + std::string(pixel_format_name(head.format)) + " for replay: ports");
  }
  if (reader.has("exposure_us")) {
    head.exposure = Exposure::microseconds(reader.integer("exposure_us", 1, 10'000'000, 1));
  }
  if (reader.has("gain_mdb")) {
    head.gain =
        Gain::millidecibels(static_cast<std::int32_t>(reader.integer("gain_mdb", -kMaxGainMdb, kMaxGainMdb, 0)));
  }
  if (reader.has("red_q12") != reader.has("blue_q12")) {
    reader.refuse(reader.has("red_q12") ? "blue_q12" : "red_q12", "is missing; a white balance needs both colours",
                  Errc::kMissingField);
  } else if (reader.has("red_q12")) {
    head.white_balance = WhiteBalance{static_cast<std::uint16_t>(reader.integer("red_q12", 256, 65535, 4096)),
                                      static_cast<std::uint16_t>(reader.integer("blue_q12", 256, 65535, 4096))};
  }
  if (reader.has("gamma")) {
    head.gamma =
        hal::Gamma::thousandths(static_cast<std::int32_t>(std::lround(1000 * reader.number("gamma", 0.1, 8, 1))));
  }
  head.wired = reader.choice<bool>("trigger_mode", {{"input", false}, {"wired", true}});
  head.trigger_delay = Duration::microseconds(reader.integer("trigger_delay_us", 0, 1'000'000, 0));
  if (head.trigger_delay >= rate.period()) {
    reader.refuse("trigger_delay_us", fmt::format("must be shorter than a frame, {} us here", rate.period().us()));
  } else if (head.trigger_delay.ns() > 0 && is_replayed(head.port.kind)) {
    reader.refuse("trigger_delay_us", "is not allowed for replay: and take: ports; replayed pictures have no trigger");
  } else if (head.trigger_delay.ns() > 0 && head.port.kind == PortKind::kV4l2 && !head.wired) {
    reader.refuse("trigger_delay_us",
                  "is only allowed for v4l2: ports with trigger_mode = \"wired\"; V4L2 has no trigger input");
  }
  if (head.port.kind == PortKind::kIidc) check_iidc(reader, head);
  head.trigger = read_line(reader, "trigger", {});
  read_device(reader, head.port.kind, rate, head.device);
  head.fields = reader.choice<Fields>("fields", {{fields_name(Fields::kProgressive), Fields::kProgressive},
                                                 {fields_name(Fields::kTopFirst), Fields::kTopFirst},
                                                 {fields_name(Fields::kBottomFirst), Fields::kBottomFirst}});
  if (head.device.separate_fields && head.fields == Fields::kProgressive) {
    reader.refuse("separate_fields", "needs interlaced frames; set fields = \"top-first\" or \"bottom-first\"");
  }
  if (head.port.kind == PortKind::kIidc && head.fields != Fields::kProgressive) {
    reader.refuse("fields", "must be \"progressive\" for iidc: ports");
  }
  if (head.fields != Fields::kProgressive && component_count(head.format) == 1 && head.format != PixelFormat::kGrey8) {
    reader.refuse("fields", "cannot be \"" + std::string(head.fields == Fields::kTopFirst ? "top" : "bottom") +
                                "-first\": pictures of format " + std::string(pixel_format_name(head.format)) +
                                " are not taken apart into fields; leave it out, or choose another format");
  }
  return head;
}

std::string read_name(TomlReader& reader) {
  std::string name = reader.required_text("name");
  if (!name.empty() && !is_name(name)) reader.refuse("name", "must be 1 to 64 characters of A-Z a-z 0-9 . _ -");
  return name;
}

std::optional<std::uint32_t> parse_whole(std::string_view text) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value == 0) return std::nullopt;
  return value;
}

std::string PortAddress::text() const { return std::string(scheme_of(kind)) + ":" + name; }

}  // namespace nodal::firmware
