#include "hal/linux/v4l2/stream.h"

#include <fmt/format.h>

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>

namespace nodal::hal::v4l2 {
namespace {

constexpr std::uint32_t kFewestBuffers = 2;  ///< one is filled while the other is read
/// Size limit of a frame, so that its length is a valid width.
constexpr std::size_t kMaxBytes = std::size_t{1} << 30;
constexpr std::uint32_t kMaxBuffers = 256;  ///< upper limit of what the driver may grant; the kernel's own limit is 32

/// An invalid time counts as the clock's start.
Instant instant_of(const timeval& time) {
  constexpr std::int64_t kHundredYears = 3'200'000'000;
  if (time.tv_sec < 0 || time.tv_sec > kHundredYears || time.tv_usec < 0 || time.tv_usec >= 1'000'000) return {};
  return Instant() + Duration::seconds(time.tv_sec) + Duration::microseconds(time.tv_usec);
}

}  // namespace

void Stream::prepare(Call& call, std::uint32_t index) const {
  call.buffer.index = index;
  call.buffer.type = device_.buffer_type();
  call.buffer.memory = V4L2_MEMORY_MMAP;
  if (!device_.multiplanar()) return;
  call.buffer.m.planes = call.planes.data();
  call.buffer.length = static_cast<std::uint32_t>(call.planes.size());
}

Status Stream::map(std::uint32_t index) {
  Call call;
  prepare(call, index);
  if (const int error = device_.ioctl(VIDIOC_QUERYBUF, &call.buffer); error != 0) {
    return fail_with("asking for a buffer", error);
  }
  const Layout& layout = granted_.layout;
  for (std::size_t p = 0; p < static_cast<std::size_t>(layout.memory_planes); ++p) {
    const std::size_t length = device_.multiplanar() ? call.planes[p].length : call.buffer.length;
    const std::size_t offset = device_.multiplanar() ? call.planes[p].m.mem_offset : call.buffer.m.offset;
    if (length < layout.needed[p]) {
      return fail(
          Errc::kDeviceFailed,
          fmt::format("head '{}': the driver's buffers have {} bytes, and a frame is {}; choose another size or format",
                      device_.head(), length, layout.needed[p]));
    }
    std::uint8_t* const start = device_.system().map(device_.fd(), length, offset);
    if (start == nullptr) return fail_with("mapping its buffers", ENOMEM);
    buffers_[index].planes[p] = {start, length, 0, 0};
  }
  return {};
}

Status Stream::begin(int buffers) {
  end();
  v4l2_requestbuffers wanted{};
  wanted.count = static_cast<std::uint32_t>(buffers);
  wanted.type = device_.buffer_type();
  wanted.memory = V4L2_MEMORY_MMAP;
  // Requests cached memory: reading uncached buffers pixel by pixel is an order of magnitude slower. Kernels and
  // drivers without support clear the flag.
  wanted.flags = V4L2_MEMORY_FLAG_NON_COHERENT;
  if (const int error = device_.ioctl(VIDIOC_REQBUFS, &wanted); error != 0) {
    return fail_with(fmt::format("asking for {} buffers", buffers), error);
  }
  allocated_ = true;
  Status begun;
  if (wanted.count < kFewestBuffers || wanted.count > kMaxBuffers) {
    begun =
        fail(Errc::kDeviceFailed,
             fmt::format("head '{}': the driver grants {} buffers, and at least {} are needed; choose a smaller size",
                         device_.head(), wanted.count, kFewestBuffers));
  } else {
    buffers_.resize(wanted.count);
  }
  for (std::uint32_t i = 0; begun && i < buffers_.size(); ++i) begun = map(i);
  for (std::uint32_t i = 0; begun && i < buffers_.size(); ++i) {
    if (const int error = queue(static_cast<BufferSlot>(i)); error != 0) begun = fail_with("queueing a buffer", error);
  }
  if (begun) {
    int type = static_cast<int>(device_.buffer_type());
    if (const int error = device_.ioctl(VIDIOC_STREAMON, &type); error != 0) {
      begun = fail_with("starting the stream", error);
    }
  }
  if (!begun) end();
  return begun;
}

void Stream::end() {
  if (!allocated_) return;
  allocated_ = false;
  int type = static_cast<int>(device_.buffer_type());
  (void)device_.ioctl(VIDIOC_STREAMOFF, &type);
  for (const Buffer& buffer : buffers_) {
    for (const Plane& plane : buffer.planes) {
      if (plane.start != nullptr) device_.system().unmap(plane.start, plane.length);
    }
  }
  buffers_.clear();
  v4l2_requestbuffers none{};
  none.type = device_.buffer_type();
  none.memory = V4L2_MEMORY_MMAP;
  (void)device_.ioctl(VIDIOC_REQBUFS, &none);
}

Status Stream::restart(const std::vector<BufferSlot>& slots) {
  int type = static_cast<int>(device_.buffer_type());
  if (const int error = device_.ioctl(VIDIOC_STREAMOFF, &type); error != 0)
    return fail_with("stopping the stream", error);
  for (Buffer& buffer : buffers_) buffer.queued = false;
  for (const BufferSlot slot : slots) {
    if (const int error = queue(slot); error != 0) return fail_with("queueing a buffer", error);
  }
  if (const int error = device_.ioctl(VIDIOC_STREAMON, &type); error != 0) {
    return fail_with("starting the stream again", error);
  }
  return {};
}

int Stream::queue(BufferSlot slot) {
  NODAL_ASSERT(slot < buffers_.size() && !buffers_[slot].queued);
  Call call;
  prepare(call, slot);
  if (device_.multiplanar()) call.buffer.length = static_cast<std::uint32_t>(granted_.layout.memory_planes);
  const int error = device_.ioctl(VIDIOC_QBUF, &call.buffer);
  buffers_[slot].queued = error == 0;
  return error;
}

int Stream::dequeue(Frame& frame) {
  Call call;
  prepare(call, 0);
  if (const int error = device_.ioctl(VIDIOC_DQBUF, &call.buffer); error != 0) return error;
  const std::uint32_t index = call.buffer.index;
  if (index >= buffers_.size() || !buffers_[index].queued) return EBADMSG;
  Buffer& buffer = buffers_[index];
  buffer.queued = false;
  frame = {static_cast<BufferSlot>(index),    call.buffer.sequence, call.buffer.flags, call.buffer.field,
           instant_of(call.buffer.timestamp), FrameVerdict::kGood};
  for (std::size_t p = 0; p < static_cast<std::size_t>(granted_.layout.memory_planes); ++p) {
    Plane& plane = buffer.planes[p];
    const std::size_t used = device_.multiplanar() ? call.planes[p].bytesused : call.buffer.bytesused;
    const std::size_t offset = device_.multiplanar() ? call.planes[p].data_offset : 0;
    const std::size_t needed = granted_.layout.needed[p];
    const bool inside = offset <= plane.length - needed;  // map() has checked that a frame fits
    plane.offset = inside ? offset : 0;
    plane.used = inside && used > offset && offset < kMaxBytes ? std::min({used, plane.length, kMaxBytes}) - offset : 0;
    if (!inside || used > plane.length) {
      frame.verdict = FrameVerdict::kCorrupt;
    } else if (used < offset + needed && frame.verdict == FrameVerdict::kGood) {
      frame.verdict = FrameVerdict::kTorn;
    }
  }
  if ((call.buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) frame.verdict = FrameVerdict::kCorrupt;
  return 0;
}

ImageView Stream::picture(BufferSlot slot) const {
  const Buffer& buffer = buffers_[slot];
  std::array<const std::uint8_t*, kMaxPlanes> planes{};
  for (std::size_t p = 0; p < planes.size(); ++p) planes[p] = buffer.planes[p].start + buffer.planes[p].offset;
  return view_of(granted_.layout, planes, buffer.planes[0].used);
}

}  // namespace nodal::hal::v4l2
