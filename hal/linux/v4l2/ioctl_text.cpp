#include "hal/linux/v4l2/ioctl_text.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <cstdint>
#include <string_view>

#include "hal/linux/v4l2/driver_text.h"
#include "hal/linux/v4l2/layout.h"

namespace nodal::hal::v4l2 {
namespace {

template <typename T>
const T& as(const void* argument) {
  return *static_cast<const T*>(argument);
}

std::string field_name(std::uint32_t field) {
  switch (field) {
    case V4L2_FIELD_ANY: return "any field order";
    case V4L2_FIELD_NONE: return "progressive";
    case V4L2_FIELD_TOP: return "top fields";
    case V4L2_FIELD_BOTTOM: return "bottom fields";
    case V4L2_FIELD_INTERLACED: return "interlaced";
    case V4L2_FIELD_SEQ_TB: return "two fields, top first";
    case V4L2_FIELD_SEQ_BT: return "two fields, bottom first";
    case V4L2_FIELD_ALTERNATE: return "alternating fields";
    case V4L2_FIELD_INTERLACED_TB: return "interlaced, top first";
    case V4L2_FIELD_INTERLACED_BT: return "interlaced, bottom first";
    default: return fmt::format("field order {}", field);
  }
}

std::string picture_text(const v4l2_format& format) {
  if (format.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE) {
    const v4l2_pix_format_mplane& pix = format.fmt.pix_mp;
    std::string text =
        fmt::format("{}x{} {}, {}", pix.width, pix.height, fourcc_text(pix.pixelformat), field_name(pix.field));
    for (std::size_t p = 0; p < pix.num_planes && p < VIDEO_MAX_PLANES; ++p) {
      text +=
          fmt::format(", plane {}: {} bytes, {} a row", p, pix.plane_fmt[p].sizeimage, pix.plane_fmt[p].bytesperline);
    }
    return text;
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  return fmt::format("{}x{} {}, {}, {} bytes, {} a row", pix.width, pix.height, fourcc_text(pix.pixelformat),
                     field_name(pix.field), pix.sizeimage, pix.bytesperline);
}

std::string control_name(std::uint32_t id) {
  switch (id) {
    case V4L2_CID_EXPOSURE_ABSOLUTE: return "EXPOSURE_ABSOLUTE";
    case V4L2_CID_EXPOSURE_AUTO: return "EXPOSURE_AUTO";
    case V4L2_CID_EXPOSURE_AUTO_PRIORITY: return "EXPOSURE_AUTO_PRIORITY";
    case V4L2_CID_GAIN: return "GAIN";
    case V4L2_CID_ANALOGUE_GAIN: return "ANALOGUE_GAIN";
    case V4L2_CID_AUTOGAIN: return "AUTOGAIN";
    case V4L2_CID_RED_BALANCE: return "RED_BALANCE";
    case V4L2_CID_BLUE_BALANCE: return "BLUE_BALANCE";
    case V4L2_CID_AUTO_WHITE_BALANCE: return "AUTO_WHITE_BALANCE";
    default: return fmt::format("control {:#x}", id);
  }
}

/// The flags of a buffer that explain a picture that is missing or wrong.
std::string flags_text(std::uint32_t flags) {
  std::string text;
  if ((flags & V4L2_BUF_FLAG_ERROR) != 0) text += ", ERROR";
  if ((flags & V4L2_BUF_FLAG_LAST) != 0) text += ", LAST";
  if ((flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) text += ", not the monotonic clock";
  if ((flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE) text += ", start of exposure";
  return text;
}

std::string dequeued_text(const v4l2_buffer& buffer) {
  const bool planes = buffer.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE && buffer.m.planes != nullptr;
  std::uint64_t bytes = buffer.bytesused;
  if (planes) {
    bytes = 0;
    for (std::uint32_t p = 0; p < buffer.length && p < VIDEO_MAX_PLANES; ++p) bytes += buffer.m.planes[p].bytesused;
  }
  return fmt::format("buffer {}, sequence {}, {} bytes, {}, at {}.{:06} s{}", buffer.index, buffer.sequence, bytes,
                     field_name(buffer.field), buffer.timestamp.tv_sec, buffer.timestamp.tv_usec,
                     flags_text(buffer.flags));
}

std::string standard_text(v4l2_std_id id) { return fmt::format("standard {:#x}", id); }

std::string size_text(const v4l2_frmsizeenum& size) {
  if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) return fmt::format("{}x{}", size.discrete.width, size.discrete.height);
  const v4l2_frmsize_stepwise& range = size.stepwise;
  return fmt::format("{}x{} to {}x{}, in steps of {}x{}", range.min_width, range.min_height, range.max_width,
                     range.max_height, range.step_width, range.step_height);
}

std::string interval_text(const v4l2_frmivalenum& interval) {
  if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
    return fmt::format("{}/{} s", interval.discrete.numerator, interval.discrete.denominator);
  }
  const v4l2_frmival_stepwise& range = interval.stepwise;
  return fmt::format("{}/{} to {}/{} s", range.min.numerator, range.min.denominator, range.max.numerator,
                     range.max.denominator);
}

/// An input that reports no picture explains a black one.
std::string input_status_text(std::uint32_t status) {
  std::string text;
  if ((status & V4L2_IN_ST_NO_POWER) != 0) text += ", no power";
  if ((status & V4L2_IN_ST_NO_SIGNAL) != 0) text += ", no signal";
  if ((status & V4L2_IN_ST_NO_COLOR) != 0) text += ", no colour";
  if ((status & V4L2_IN_ST_NO_H_LOCK) != 0) text += ", no horizontal lock";
  if ((status & V4L2_IN_ST_NO_SYNC) != 0) text += ", no synchronization";
  return text;
}

}  // namespace

std::string request_name(unsigned long request) {
  switch (request) {
    case VIDIOC_QUERYCAP: return "VIDIOC_QUERYCAP";
    case VIDIOC_ENUM_FMT: return "VIDIOC_ENUM_FMT";
    case VIDIOC_ENUM_FRAMESIZES: return "VIDIOC_ENUM_FRAMESIZES";
    case VIDIOC_ENUM_FRAMEINTERVALS: return "VIDIOC_ENUM_FRAMEINTERVALS";
    case VIDIOC_G_FMT: return "VIDIOC_G_FMT";
    case VIDIOC_S_FMT: return "VIDIOC_S_FMT";
    case VIDIOC_G_PARM: return "VIDIOC_G_PARM";
    case VIDIOC_S_PARM: return "VIDIOC_S_PARM";
    case VIDIOC_ENUMINPUT: return "VIDIOC_ENUMINPUT";
    case VIDIOC_G_INPUT: return "VIDIOC_G_INPUT";
    case VIDIOC_S_INPUT: return "VIDIOC_S_INPUT";
    case VIDIOC_ENUMSTD: return "VIDIOC_ENUMSTD";
    case VIDIOC_G_STD: return "VIDIOC_G_STD";
    case VIDIOC_S_STD: return "VIDIOC_S_STD";
    case VIDIOC_QUERYCTRL: return "VIDIOC_QUERYCTRL";
    case VIDIOC_G_CTRL: return "VIDIOC_G_CTRL";
    case VIDIOC_S_CTRL: return "VIDIOC_S_CTRL";
    case VIDIOC_REQBUFS: return "VIDIOC_REQBUFS";
    case VIDIOC_QUERYBUF: return "VIDIOC_QUERYBUF";
    case VIDIOC_QBUF: return "VIDIOC_QBUF";
    case VIDIOC_DQBUF: return "VIDIOC_DQBUF";
    case VIDIOC_STREAMON: return "VIDIOC_STREAMON";
    case VIDIOC_STREAMOFF: return "VIDIOC_STREAMOFF";
    default: return fmt::format("request {:#x}", request);
  }
}

std::string asked_text(unsigned long request, const void* argument) {
  switch (request) {
    case VIDIOC_ENUM_FMT: return fmt::format("format {}", as<v4l2_fmtdesc>(argument).index);
    case VIDIOC_ENUM_FRAMESIZES: {
      const auto& size = as<v4l2_frmsizeenum>(argument);
      return fmt::format("size {} of {}", size.index, fourcc_text(size.pixel_format));
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
      const auto& interval = as<v4l2_frmivalenum>(argument);
      return fmt::format("interval {} of {} at {}x{}", interval.index, fourcc_text(interval.pixel_format),
                         interval.width, interval.height);
    }
    case VIDIOC_S_FMT: return picture_text(as<v4l2_format>(argument));
    case VIDIOC_S_PARM: {
      const v4l2_fract& period = as<v4l2_streamparm>(argument).parm.capture.timeperframe;
      return fmt::format("a frame every {}/{} s", period.numerator, period.denominator);
    }
    case VIDIOC_ENUMINPUT: return fmt::format("input {}", as<v4l2_input>(argument).index);
    case VIDIOC_S_INPUT: return fmt::format("input {}", as<int>(argument));
    case VIDIOC_ENUMSTD: return fmt::format("standard {}", as<v4l2_standard>(argument).index);
    case VIDIOC_S_STD: return standard_text(as<v4l2_std_id>(argument));
    case VIDIOC_QUERYCTRL: return control_name(as<v4l2_queryctrl>(argument).id);
    case VIDIOC_G_CTRL: return control_name(as<v4l2_control>(argument).id);
    case VIDIOC_S_CTRL: {
      const auto& control = as<v4l2_control>(argument);
      return fmt::format("{} = {}", control_name(control.id), control.value);
    }
    case VIDIOC_REQBUFS: return fmt::format("{} buffers", as<v4l2_requestbuffers>(argument).count);
    case VIDIOC_QUERYBUF:
    case VIDIOC_QBUF: return fmt::format("buffer {}", as<v4l2_buffer>(argument).index);
    default: return {};
  }
}

std::string answered_text(unsigned long request, const void* argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      const auto& capability = as<v4l2_capability>(argument);
      return fmt::format("driver {}, card {}, bus {}, capabilities {:#x}", text_of(capability.driver),
                         text_of(capability.card), text_of(capability.bus_info), capability.device_caps);
    }
    case VIDIOC_ENUM_FMT: {
      const auto& format = as<v4l2_fmtdesc>(argument);
      return fourcc_text(format.pixelformat) + " (" + text_of(format.description) + ")";
    }
    case VIDIOC_ENUM_FRAMESIZES: return size_text(as<v4l2_frmsizeenum>(argument));
    case VIDIOC_ENUM_FRAMEINTERVALS: return interval_text(as<v4l2_frmivalenum>(argument));
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT: return picture_text(as<v4l2_format>(argument));
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      const v4l2_fract& period = as<v4l2_streamparm>(argument).parm.capture.timeperframe;
      return fmt::format("a frame every {}/{} s", period.numerator, period.denominator);
    }
    case VIDIOC_ENUMINPUT: {
      const auto& input = as<v4l2_input>(argument);
      return text_of(input.name) + input_status_text(input.status);
    }
    case VIDIOC_G_INPUT: return fmt::format("input {}", as<int>(argument));
    case VIDIOC_ENUMSTD: return text_of(as<v4l2_standard>(argument).name);
    case VIDIOC_G_STD: return standard_text(as<v4l2_std_id>(argument));
    case VIDIOC_QUERYCTRL: {
      const auto& control = as<v4l2_queryctrl>(argument);
      return fmt::format("{} to {} in steps of {}, by default {}, flags {:#x}", control.minimum, control.maximum,
                         control.step, control.default_value, control.flags);
    }
    case VIDIOC_G_CTRL:
    case VIDIOC_S_CTRL: return fmt::format("{}", as<v4l2_control>(argument).value);
    case VIDIOC_REQBUFS: return fmt::format("{} buffers", as<v4l2_requestbuffers>(argument).count);
    case VIDIOC_QUERYBUF: return fmt::format("{} bytes", as<v4l2_buffer>(argument).length);
    case VIDIOC_DQBUF: return dequeued_text(as<v4l2_buffer>(argument));
    default: return {};
  }
}

}  // namespace nodal::hal::v4l2
