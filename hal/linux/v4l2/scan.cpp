#include "hal/linux/v4l2/scan.h"

#include <fmt/format.h>

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <system_error>

#include "hal/linux/thread/thread.h"
#include "hal/linux/v4l2/device.h"
#include "hal/linux/v4l2/driver_text.h"
#include "hal/linux/v4l2/layout.h"
#include "protocol/base/text.h"

namespace nodal::hal::v4l2 {
namespace {

constexpr std::size_t kLongestText = 64;
constexpr std::uint32_t kSmallestSide = 16, kLargestSide = 16384;  ///< px; width or height of a head's picture

template <std::size_t kSize>
std::string shown_text(const std::uint8_t (&field)[kSize]) {
  return printable(text_of(field), kLongestText);
}

/// Asks one device, and counts the questions.
class Question {
 public:
  Question(const Device& device, FoundDevice& found) : device_(device), found_(found) {}

  void ask_all() {
    ask_input();
    for (std::uint32_t i = 0;; ++i) {
      v4l2_fmtdesc description{};
      description.index = i;
      description.type = device_.buffer_type();
      if (!ask(VIDIOC_ENUM_FMT, &description)) break;
      if (found_.formats.size() == kMaxFormats) {
        odd(fmt::format("lists more than {} formats; the others are left out", kMaxFormats));
        break;
      }
      found_.formats.push_back(format(description.pixelformat));
    }
    if (out_of_questions_) {
      odd(fmt::format("answers more than {} questions for formats, sizes and rates; the rest is left out",
                      kMaxEnumerations));
    }
    ask_controls();
  }

 private:
  void odd(const std::string& sentence) {
    if (std::find(found_.oddities.begin(), found_.oddities.end(), sentence) == found_.oddities.end()) {
      found_.oddities.push_back(sentence);
    }
  }

  bool ask(unsigned long request, void* argument) {
    if (asked_ == kMaxEnumerations) {
      out_of_questions_ = true;
      return false;
    }
    ++asked_;
    return device_.ioctl(request, argument) == 0;
  }

  void ask_input() {
    int current = 0;
    v4l2_input input{};
    if (!ask(VIDIOC_G_INPUT, &current) || current < 0) return;
    input.index = static_cast<std::uint32_t>(current);
    if (ask(VIDIOC_ENUMINPUT, &input)) found_.input = shown_text(input.name);
    v4l2_std_id standard = 0;
    if (!ask(VIDIOC_G_STD, &standard) || standard == 0) return;
    for (std::uint32_t i = 0;; ++i) {
      v4l2_standard each{};
      each.index = i;
      if (!ask(VIDIOC_ENUMSTD, &each)) return;
      if ((each.id & standard) == 0) continue;
      found_.standard = FrameRate::make(each.frameperiod.denominator, each.frameperiod.numerator);
      if (!found_.standard) odd("reports a standard with a frame period that cannot be");
      // M/NTSC transmits the bottom field first.
      found_.fields = (standard & V4L2_STD_525_60) != 0 ? Fields::kBottomFirst : Fields::kTopFirst;
      return;
    }
  }

  FoundFormat format(std::uint32_t code) {
    FoundFormat format;
    format.name = fourcc_text(code);
    for (const PixelFormat pixels :
         {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kI422, PixelFormat::kYuyv, PixelFormat::kUyvy,
          PixelFormat::kRgb24, PixelFormat::kGrey8, PixelFormat::kMjpeg, PixelFormat::kRggb8, PixelFormat::kGrbg8,
          PixelFormat::kGbrg8, PixelFormat::kBggr8}) {
      for (const FourCc& each : fourccs_of(pixels)) {
        if (each.code == code && (each.memory_planes == 1 || device_.multiplanar())) format.pixels = pixels;
      }
    }
    for (std::uint32_t i = 0;; ++i) {
      v4l2_frmsizeenum size{};
      size.index = i;
      size.pixel_format = code;
      if (!ask(VIDIOC_ENUM_FRAMESIZES, &size)) break;
      if (format.sizes.size() == kMaxSizes) {
        odd(fmt::format("lists more than {} sizes of {}; the others are left out", kMaxSizes, format.name));
        break;
      }
      if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
        add_size(format, code, size.discrete.width, size.discrete.height);
        continue;
      }
      format.size_range = true;
      add_size(format, code, size.stepwise.max_width, size.stepwise.max_height);
      add_size(format, code, size.stepwise.min_width, size.stepwise.min_height);
      break;
    }
    // A device that lists no sizes has its present one, for instance that of a video standard.
    if (format.sizes.empty() || format.size_range) add_present_size(format, code);
    return format;
  }

  void add_present_size(FoundFormat& format, std::uint32_t code) {
    v4l2_format now{};
    now.type = device_.buffer_type();
    if (!ask(VIDIOC_G_FMT, &now)) return;
    if (device_.multiplanar()) add_size(format, code, now.fmt.pix_mp.width, now.fmt.pix_mp.height);
    else add_size(format, code, now.fmt.pix.width, now.fmt.pix.height);
  }

  void add_size(FoundFormat& format, std::uint32_t code, std::uint32_t width, std::uint32_t height) {
    if (std::min(width, height) < kSmallestSide || std::max(width, height) > kLargestSide) {
      odd(fmt::format("offers {} of {}x{}, which is no size of a picture for a head; left out", format.name, width,
                      height));
      return;
    }
    FoundSize size{static_cast<int>(width), static_cast<int>(height), {}, false};
    for (const FoundSize& one : format.sizes) {
      if (one.width == size.width && one.height == size.height) return;
    }
    if (found_.standard) size.rates = {*found_.standard};
    for (std::uint32_t i = 0; !found_.standard; ++i) {
      v4l2_frmivalenum interval{};
      interval.index = i;
      interval.pixel_format = code;
      interval.width = width;
      interval.height = height;
      if (!ask(VIDIOC_ENUM_FRAMEINTERVALS, &interval)) break;
      if (size.rates.size() == kMaxFrameRates) {
        odd(fmt::format("lists more than {} rates of a size; the others are left out", kMaxFrameRates));
        break;
      }
      if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
        add_rate(size, interval.discrete);
        continue;
      }
      add_rate(size, interval.stepwise.min);
      add_rate(size, interval.stepwise.max);
      size.rate_range = size.rates.size() == 2;
      break;
    }
    std::sort(size.rates.begin(), size.rates.end(), [](FrameRate a, FrameRate b) { return a.period() < b.period(); });
    format.sizes.push_back(std::move(size));
  }

  void add_rate(FoundSize& size, const v4l2_fract& period) {
    if (const auto rate = FrameRate::make(period.denominator, period.numerator)) {
      size.rates.push_back(*rate);
    } else {
      odd(fmt::format("offers a frame period of {}/{} s; left out", period.numerator, period.denominator));
    }
  }

  void ask_controls() {
    for (const std::uint32_t id : {V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_GAIN, V4L2_CID_ANALOGUE_GAIN,
                                   V4L2_CID_RED_BALANCE, V4L2_CID_BLUE_BALANCE, V4L2_CID_WHITE_BALANCE_TEMPERATURE}) {
      v4l2_queryctrl query{};
      query.id = id;
      if (device_.ioctl(VIDIOC_QUERYCTRL, &query) != 0 || (query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) continue;
      const std::string name = shown_text(query.name);
      if (query.minimum > query.maximum || query.default_value < query.minimum || query.default_value > query.maximum) {
        odd(fmt::format("reports for '{}' a range of {} to {} and a default of {}; left out", name, query.minimum,
                        query.maximum, query.default_value));
        continue;
      }
      found_.controls.push_back({name, query.minimum, query.maximum, std::max(query.step, 1), query.default_value});
    }
  }

  const Device& device_;
  FoundDevice& found_;
  int asked_ = 0;
  bool out_of_questions_ = false;
};

/// Nothing for nodes that do not capture.
std::optional<FoundDevice> scan_one(System& system, const std::string& node) {
  FoundDevice found;
  found.node = node;
  found.port = "v4l2:" + node;
  const auto device = open_device(system, node, node);
  if (!device) {
    if (device.error().code == Errc::kNoSuchDevice) return std::nullopt;
    found.problem = device.error();
    return found;
  }
  v4l2_capability capability{};
  if ((*device)->ioctl(VIDIOC_QUERYCAP, &capability) == 0) found.driver = shown_text(capability.driver);
  found.model = printable((*device)->card(), kLongestText);
  if (const std::string bus = (*device)->bus(); !bus.empty() && is_printable(bus)) found.port = "v4l2:" + bus;
  found.usb = system.usb(node);
  Question(**device, found).ask_all();
  return found;
}

}  // namespace

/// What the threads report; it outlives the Scanner if one of them hangs.
struct Scanner::Answers {
  std::mutex mutex;
  std::condition_variable changed;
  std::map<std::string, std::optional<FoundDevice>> by_node;  ///< answers by node, also late ones of earlier scans
  std::set<std::string> asked;                                ///< device nodes whose threads have not answered
};

Scanner::Scanner(System& system) : system_(system), answers_(std::make_shared<Answers>()) {}

/// Returns false if the system refuses a thread.
bool Scanner::ask(const std::string& node) {
  {
    const std::lock_guard lock(answers_->mutex);
    answers_->by_node.erase(node);
    if (!answers_->asked.insert(node).second) return true;
  }
  try {
    Thread("nodal-scan", node, [&system = system_, node, answers = answers_] {
      std::optional<FoundDevice> found = scan_one(system, node);
      const std::lock_guard lock(answers->mutex);
      answers->by_node[node] = std::move(found);
      answers->asked.erase(node);
      answers->changed.notify_all();
    }).detach();
    return true;
  } catch (const std::system_error&) {
    const std::lock_guard lock(answers_->mutex);
    answers_->asked.erase(node);
    return false;
  }
}

std::vector<FoundDevice> Scanner::scan(std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  std::vector<std::string> nodes = system_.nodes();
  if (nodes.size() > kMaxNodes) nodes.resize(kMaxNodes);
  std::set<std::string> refused;
  for (const std::string& node : nodes) {
    if (!ask(node)) refused.insert(node);
  }
  std::unique_lock lock(answers_->mutex);
  answers_->changed.wait_until(lock, until, [&] {
    return std::all_of(nodes.begin(), nodes.end(), [&](const std::string& node) {
      return refused.contains(node) || answers_->by_node.contains(node);
    });
  });

  std::vector<FoundDevice> all;
  std::set<std::string> ports;
  for (const std::string& node : nodes) {
    const auto answer = answers_->by_node.find(node);
    if (answer == answers_->by_node.end()) {
      FoundDevice silent;
      silent.node = node;
      silent.port = "v4l2:" + node;
      silent.problem =
          refused.contains(node)
              ? Error{Errc::kOverload,
                      node + ": the system refuses a thread to ask it; raise the limit (TasksMax=, ulimit -u)"}
              : Error{Errc::kTimeout, node + ": the device does not answer; unplug it and plug it in again"};
      all.push_back(std::move(silent));
    } else if (answer->second) {
      FoundDevice& found = *answer->second;
      if (!ports.insert(found.port).second) {
        found.second_stream = found.usb.has_value();
        found.port = "v4l2:" + node;
      }
      all.push_back(std::move(found));
    }
  }
  answers_->by_node.clear();
  return all;
}

}  // namespace nodal::hal::v4l2
