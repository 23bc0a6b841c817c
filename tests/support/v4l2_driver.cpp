#include "tests/support/v4l2_driver.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <numeric>

namespace nodal::test {
namespace {

template <std::size_t kSize>
void write_text(std::uint8_t (&field)[kSize], const char* text) {
  std::memcpy(field, text, std::strlen(text) + 1);
}

}  // namespace

std::uint32_t V4l2Driver::planes() const {
  return code_ == V4L2_PIX_FMT_YUV420M ? 3 : code_ == V4L2_PIX_FMT_NV12M ? 2 : 1;
}

std::uint32_t V4l2Driver::stride(std::uint32_t plane) const {
  const std::uint32_t bytes = code_ == V4L2_PIX_FMT_YUYV                   ? 2 * width
                              : code_ == V4L2_PIX_FMT_RGB24                ? 3 * width
                              : code_ == V4L2_PIX_FMT_YUV420M && plane > 0 ? width / 2
                                                                           : width;
  return bytes + padding;
}

std::uint32_t V4l2Driver::size(std::uint32_t plane) const {
  const bool halved = code_ == V4L2_PIX_FMT_YUV420 || code_ == V4L2_PIX_FMT_NV12;
  const std::uint32_t rows = planes() > 1 && plane > 0 ? height / 2 : halved ? height * 3 / 2 : height;
  return stride(plane) * rows;
}

void V4l2Driver::unplug() {
  const std::lock_guard lock(mutex_);
  there_ = false;
  for (auto& [fd, gone] : open_) gone = true;
}

void V4l2Driver::plug_in() {
  const std::lock_guard lock(mutex_);
  there_ = true;
  streaming_ = false;
  unplugged_.insert(unplugged_.end(), std::make_move_iterator(buffers_.begin()),
                    std::make_move_iterator(buffers_.end()));
  buffers_.clear();
  queued_.clear();
  done_.clear();
}

int V4l2Driver::calls(unsigned long request) const {
  const std::lock_guard lock(mutex_);
  const auto found = calls_.find(request);
  return found == calls_.end() ? 0 : found->second;
}

std::int32_t V4l2Driver::control(std::uint32_t id) const {
  const std::lock_guard lock(mutex_);
  return controls.at(id).value;
}

int V4l2Driver::open_descriptors() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(open_.size());
}

int V4l2Driver::mappings() const {
  const std::lock_guard lock(mutex_);
  return mappings_;
}

bool V4l2Driver::is_open(int fd) const {
  const std::lock_guard lock(mutex_);
  return open_.count(fd) != 0;
}

bool V4l2Driver::readable(int fd) {
  const std::lock_guard lock(mutex_);
  if (open_.at(fd) || !streaming_) return true;
  expose();
  return !done_.empty();
}

int V4l2Driver::open(const std::string& node) {
  const std::lock_guard lock(mutex_);
  if (node != "/dev/video7" || !there_) return -ENOENT;
  open_[next_fd_] = false;
  return next_fd_++;
}

void V4l2Driver::close(int fd) {
  const std::lock_guard lock(mutex_);
  open_.erase(fd);
  if (fd != owner_) return;  // closing the queue owner's descriptor releases its buffers
  streaming_ = false;
  queued_.clear();
  done_.clear();
  buffers_.clear();
}

int V4l2Driver::ioctl(int fd, unsigned long request, void* argument) {
  if (before) {
    if (const int error = before(request); error != 0) return error;
  }
  const std::lock_guard lock(mutex_);
  ++calls_[request];
  if (open_.at(fd)) return ENODEV;
  if (request == VIDIOC_REQBUFS) owner_ = fd;
  const int error = answer(request, argument);
  if (error == 0 && after) after(request, argument);
  return error;
}

std::uint8_t* V4l2Driver::map(int, std::size_t length, std::size_t offset) {
  const std::lock_guard lock(mutex_);
  auto& plane = buffers_.at(offset / 8).planes.at(offset % 8);
  if (length > plane.size()) return nullptr;  // like the kernel
  ++mappings_;
  return plane.data();
}

void V4l2Driver::unmap(std::uint8_t*, std::size_t) {
  const std::lock_guard lock(mutex_);
  --mappings_;
}

int V4l2Driver::answer(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& capability = *static_cast<v4l2_capability*>(argument);
      write_text(capability.card, "Camera");
      write_text(capability.bus_info, "usb-1.2");
      capability.capabilities = V4L2_CAP_DEVICE_CAPS;
      capability.device_caps =
          V4L2_CAP_STREAMING | (multiplanar ? V4L2_CAP_VIDEO_CAPTURE_MPLANE : V4L2_CAP_VIDEO_CAPTURE);
      return 0;
    }
    case VIDIOC_G_INPUT: *static_cast<int*>(argument) = 0; return 0;
    case VIDIOC_S_INPUT: return *static_cast<int*>(argument) == 0 ? 0 : EINVAL;
    case VIDIOC_ENUMINPUT: {
      auto& input = *static_cast<v4l2_input*>(argument);
      if (input.index != 0) return EINVAL;
      write_text(input.name, "S-Video");
      return 0;
    }
    case VIDIOC_G_STD: *static_cast<v4l2_std_id*>(argument) = standard; return standard == 0 ? ENODATA : 0;
    case VIDIOC_S_STD:
      if (standard == 0) return ENODATA;
      standard = *static_cast<v4l2_std_id*>(argument);
      return 0;
    case VIDIOC_ENUM_FMT:
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT:
    case VIDIOC_S_PARM: return format_call(request, argument);
    case VIDIOC_QUERYCTRL:
    case VIDIOC_G_CTRL:
    case VIDIOC_S_CTRL: return control_call(request, argument);
    case VIDIOC_REQBUFS:
    case VIDIOC_QUERYBUF:
    case VIDIOC_QBUF:
    case VIDIOC_DQBUF:
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF: return buffer_call(request, argument);
    default: return ENOTTY;
  }
}

int V4l2Driver::format_call(unsigned long request, void* argument) {
  if (request == VIDIOC_ENUM_FMT) {
    auto& description = *static_cast<v4l2_fmtdesc*>(argument);
    if (description.index >= formats.size()) return EINVAL;
    description.pixelformat = formats[description.index];
    return 0;
  }
  if (request == VIDIOC_S_PARM) {
    auto& capture = static_cast<v4l2_streamparm*>(argument)->parm.capture;
    capture.capability = V4L2_CAP_TIMEPERFRAME;
    capture.timeperframe = period;
    return 0;
  }
  auto& format = *static_cast<v4l2_format*>(argument);
  if (request == VIDIOC_S_FMT) {
    if (!buffers_.empty()) return EBUSY;
    const std::uint32_t wanted = multiplanar ? format.fmt.pix_mp.pixelformat : format.fmt.pix.pixelformat;
    if (std::find(formats.begin(), formats.end(), wanted) != formats.end()) code_ = wanted;
  }
  if (multiplanar) {
    v4l2_pix_format_mplane& mp = format.fmt.pix_mp;
    mp.width = width;
    mp.height = height;
    mp.pixelformat = code_;
    mp.field = field;
    mp.quantization = static_cast<std::uint8_t>(quantization);
    mp.ycbcr_enc = static_cast<std::uint8_t>(encoding);
    mp.colorspace = colorspace;
    mp.num_planes = static_cast<std::uint8_t>(planes());
    for (std::uint32_t p = 0; p < planes(); ++p) mp.plane_fmt[p] = {size(p), stride(p), {}};
    return 0;
  }
  v4l2_pix_format& pix = format.fmt.pix;
  pix.width = width;
  pix.height = height;
  pix.pixelformat = code_;
  pix.field = field;
  pix.quantization = quantization;
  pix.ycbcr_enc = encoding;
  pix.colorspace = colorspace;
  pix.bytesperline = code_ == V4L2_PIX_FMT_MJPEG ? 0 : stride(0);
  pix.sizeimage = size(0);
  return 0;
}

int V4l2Driver::control_call(unsigned long request, void* argument) {
  if (request == VIDIOC_QUERYCTRL) {
    auto& query = *static_cast<v4l2_queryctrl*>(argument);
    const auto found = controls.find(query.id);
    if (found == controls.end()) return EINVAL;
    query.minimum = found->second.low;
    query.maximum = found->second.high;
    query.step = found->second.step;
    query.default_value = found->second.usual;
    return 0;
  }
  auto& control = *static_cast<v4l2_control*>(argument);
  const auto found = controls.find(control.id);
  if (found == controls.end()) return EINVAL;
  if (request == VIDIOC_S_CTRL) {
    if (control.value < found->second.low || control.value > found->second.high) return ERANGE;
    found->second.value = control.value;
  }
  control.value = found->second.value;
  return 0;
}

int V4l2Driver::allocate(v4l2_requestbuffers& wanted) {
  streaming_ = false;
  queued_.clear();
  done_.clear();
  if (wanted.count > 0) wanted.count = std::clamp(wanted.count, fewest_buffers, most_buffers);
  buffers_.assign(wanted.count, {});
  for (Buffer& buffer : buffers_) {
    for (std::uint32_t p = 0; p < planes(); ++p) buffer.planes.emplace_back(size(p));
  }
  return 0;
}

int V4l2Driver::describe(std::uint32_t index, v4l2_buffer& buffer) {
  if (index >= buffers_.size()) return EINVAL;
  const Buffer& one = buffers_[index];
  buffer.index = index;
  for (std::uint32_t p = 0; p < planes(); ++p) {
    const auto length = static_cast<std::uint32_t>(one.planes[p].size());
    if (multiplanar) {
      buffer.m.planes[p] = {};
      buffer.m.planes[p].length = buffer.m.planes[p].bytesused = length;
      buffer.m.planes[p].m.mem_offset = index * 8 + p;
    } else {
      buffer.length = buffer.bytesused = length;
      if (code_ == V4L2_PIX_FMT_MJPEG) buffer.bytesused = static_cast<std::uint32_t>(jpeg.size());
      buffer.m.offset = index * 8;
    }
  }
  return 0;
}

/// Frame n goes into the oldest queued buffer and ends n + 1 periods after the start; without a buffer it is lost.
void V4l2Driver::expose() {
  if (!streaming_) return;
  const bool alternate = field == V4L2_FIELD_ALTERNATE;
  const FrameRate rate{period.denominator * (alternate ? 2 : 1), period.numerator};
  for (;; ++exposed_) {
    const Instant end = started_ + rate.start_of(exposed_ + 1);
    if (end > clock_.now()) return;
    if (queued_.empty() || lost_fields.count(exposed_) != 0) continue;
    Buffer& buffer = buffers_[queued_.front()];
    for (auto& plane : buffer.planes) {
      std::iota(plane.begin(), plane.end(), static_cast<std::uint8_t>(37 * exposed_));
      if (code_ == V4L2_PIX_FMT_MJPEG) std::copy(jpeg.begin(), jpeg.end(), plane.begin());
    }
    buffer.state = Buffer::State::kDone;
    buffer.sequence = static_cast<std::uint32_t>(alternate ? exposed_ / 2 : exposed_);
    buffer.field = field;
    if (alternate) {
      const bool bottom_first = (standard & V4L2_STD_525_60) != 0;
      buffer.field = (exposed_ % 2 == 0) == bottom_first ? V4L2_FIELD_BOTTOM : V4L2_FIELD_TOP;
    }
    buffer.end = end;
    done_.push_back(queued_.front());
    queued_.pop_front();
  }
}

int V4l2Driver::buffer_call(unsigned long request, void* argument) {
  if (request == VIDIOC_REQBUFS) return allocate(*static_cast<v4l2_requestbuffers*>(argument));
  if (request == VIDIOC_STREAMON) {
    if (buffers_.empty()) return EINVAL;
    streaming_ = true;
    started_ = clock_.now();
    exposed_ = 0;
    return 0;
  }
  if (request == VIDIOC_STREAMOFF) {
    streaming_ = false;
    queued_.clear();
    done_.clear();
    for (Buffer& buffer : buffers_) buffer.state = Buffer::State::kIdle;
    return 0;
  }
  auto& buffer = *static_cast<v4l2_buffer*>(argument);
  expose();
  if (request == VIDIOC_QUERYBUF) return describe(buffer.index, buffer);
  if (request == VIDIOC_QBUF) {
    if (buffer.index >= buffers_.size() || buffers_[buffer.index].state != Buffer::State::kIdle) return EINVAL;
    buffers_[buffer.index].state = Buffer::State::kQueued;
    queued_.push_back(buffer.index);
    return 0;
  }
  if (!streaming_) return EINVAL;
  if (done_.empty()) return EAGAIN;
  const std::uint32_t index = done_.front();
  done_.pop_front();
  Buffer& one = buffers_[index];
  one.state = Buffer::State::kIdle;
  describe(index, buffer);
  buffer.sequence = one.sequence;
  buffer.field = one.field;
  buffer.flags = timestamp_flags;
  buffer.timestamp.tv_sec = one.end.ns() / 1'000'000'000;
  buffer.timestamp.tv_usec = one.end.ns() % 1'000'000'000 / 1'000;
  return 0;
}

}  // namespace nodal::test
