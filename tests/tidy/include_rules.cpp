#include "include_rules.h"

#include <algorithm>

namespace nodal::tidy {
namespace {

bool covers(std::string_view pattern, std::string_view path) {
  return pattern.ends_with('/') ? path.starts_with(pattern) : path == pattern;
}

bool any_covers(const std::vector<std::string_view>& patterns, std::string_view path) {
  return std::ranges::any_of(patterns, [&](std::string_view pattern) { return covers(pattern, path); });
}

std::string join(const std::vector<std::string_view>& names) {
  std::string all;
  for (const std::string_view name : names) {
    all += (all.empty() ? "" : ", ") + std::string(name);
  }
  return all;
}

const FolderRule* rule_of(std::string_view file) {
  const FolderRule* best = nullptr;
  for (const FolderRule& rule : folder_rules()) {
    if (file.starts_with(rule.folder) && (best == nullptr || rule.folder.size() > best->folder.size())) {
      best = &rule;
    }
  }
  return best;
}

}  // namespace

const std::vector<FolderRule>& folder_rules() {
  // hal/*.h are the ports; each is named by its header, so that hal/sim/ and its like are not meant.
  const auto ports_and = [](std::vector<std::string_view> more) {
    for (const char* port : {"hal/clock.h", "hal/disk.h", "hal/head.h", "hal/link.h", "hal/pin.h", "hal/trigger.h",
                             "hal/watchdog.h"}) {
      more.emplace_back(port);
    }
    return more;
  };
  static const std::vector<FolderRule> rules{
      {"protocol/base/", {"protocol/base/"}},
      {"protocol/", {"protocol/"}},
      {"hal/", ports_and({"protocol/base/"})},
      // The simulator knows the calibration document, but none of the stitcher's code: it is the ground truth.
      {"hal/sim/", ports_and({"protocol/base/", "protocol/calibration.h", "hal/sim/"})},
      {"hal/replay/", ports_and({"protocol/base/", "hal/replay/"})},
      {"hal/linux/", ports_and({"protocol/base/", "hal/linux/"})},
      {"stitch/blend/", {"protocol/base/", "stitch/blend/"}},
      {"stitch/geometry/", {"protocol/base/", "protocol/calibration.h", "protocol/lens_range.h", "stitch/geometry/"}},
      {"stitch/interchange/", {"protocol/base/", "protocol/calibration.h", "protocol/lens_range.h", "stitch/geometry/",
                               "stitch/interchange/"}},
      {"stitch/calibration/", {"protocol/base/", "protocol/calibration.h", "protocol/lens_range.h", "stitch/geometry/",
                               "stitch/calibration/"}},
      {"stitch/registration/", {"protocol/base/", "protocol/calibration.h", "stitch/geometry/",
                                "stitch/registration/"}},
      {"stitch/view/", {"protocol/base/", "stitch/geometry/", "stitch/view/"}},
      {"stitch/table/", {"protocol/", "stitch/geometry/", "stitch/blend/", "stitch/table/"}},
      {"firmware/", ports_and({"protocol/", "stitch/blend/", "stitch/table/", "firmware/"})},
      {"firmware/daemon/", {"protocol/", "hal/", "stitch/blend/", "stitch/table/", "firmware/"}},
      {"host_tool/", {"protocol/", "hal/link.h", "hal/linux/link/", "hal/replay/image_file.h", "stitch/", "host_tool/"}},
      {"tests/", {"protocol/", "hal/", "stitch/", "firmware/", "host_tool/", "tests/"}},
  };
  return rules;
}

const std::vector<LibraryRule>& library_rules() {
  static const std::vector<std::string_view> stepped{"stitch/", "firmware/"};
  static const std::vector<LibraryRule> rules{
      {"Eigen/", {"stitch/", "tests/"}, {"stitch/blend/"}, "double precision stays off the rig's hot path"},
      {"linux/videodev2.h", {"hal/linux/", "tests/"}, {}, "a camera is a HeadPort to everybody else"},
      {"libusb-1.0/", {"hal/linux/", "tests/"}, {}, "USB is a LinkPort to everybody else"},
      {"dc1394/", {"hal/linux/", "tests/"}, {}, "a camera is a HeadPort to everybody else"},
      {"gpiod.h", {"hal/linux/", "tests/"}, {}, "a pin is a PinPort to everybody else"},
      {"cmath", {""}, {"stitch/blend/"}, "the blend is integer only"},
      {"thread", {"firmware/daemon/", "hal/", "host_tool/", "stitch/registration/", "tests/"}, {},
       "stages are stepped: they own no thread (registration is the host's)"},
      {"mutex", {"firmware/daemon/", "hal/", "host_tool/", "tests/"}, {}, "stages are stepped: they wait on no lock"},
      {"condition_variable", {"firmware/daemon/", "hal/", "host_tool/", "tests/"}, {},
       "stages are stepped: they wait for nothing"},
      {"fstream", {""}, {"firmware/", "stitch/"}, "files are the DiskPort's"},
      {"sys/socket.h", {""}, {"firmware/", "stitch/", "protocol/"}, "sockets are the LinkPort's"},
      {"fcntl.h", {""}, {"stitch/", "protocol/"}, "files are the DiskPort's"},
  };
  return rules;
}

std::optional<Include> parse_include(std::string_view line) {
  const auto skip_blanks = [&line] {
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  };
  skip_blanks();
  if (!line.starts_with('#')) return std::nullopt;
  line.remove_prefix(1);
  skip_blanks();
  if (!line.starts_with("include")) return std::nullopt;
  line.remove_prefix(7);
  skip_blanks();
  if (line.empty() || (line.front() != '"' && line.front() != '<')) return std::nullopt;
  const bool quoted = line.front() == '"';
  line.remove_prefix(1);
  const std::size_t end = line.find(quoted ? '"' : '>');
  if (end == std::string_view::npos) return std::nullopt;
  return Include{std::string(line.substr(0, end)), quoted};
}

std::optional<std::string> violation(std::string_view file, const Include& include) {
  const std::string what = std::string(file) + ": #include of " + include.header;
  if (!include.quoted) {
    for (const LibraryRule& rule : library_rules()) {
      if (!covers(rule.header, include.header)) continue;
      const bool somewhere = std::ranges::any_of(
          rule.only_in, [&](std::string_view folder) { return file.starts_with(folder); });
      const bool forbidden = std::ranges::any_of(
          rule.but_not_in, [&](std::string_view folder) { return file.starts_with(folder); });
      const bool daemon = file.starts_with("firmware/daemon/");
      if (!somewhere || (forbidden && !daemon)) return what + ": " + std::string(rule.why);
    }
    return std::nullopt;
  }
  const FolderRule* rule = rule_of(file);
  if (rule == nullptr) return what + ": the folder has no rule; give it one in tests/tidy/include_rules.cpp";
  if (include.header.find('/') == std::string::npos || include.header.starts_with("../")) {
    if (rule->folder == "tests/") return std::nullopt;  // a suite's own helper, or the one beside it
    return what + ": write includes from the root, such as \"hal/head.h\"";
  }
  if (!any_covers(rule->may_include, include.header)) {
    return what + ": " + std::string(rule->folder) + " may include only " + join(rule->may_include);
  }
  return std::nullopt;
}

}  // namespace nodal::tidy
