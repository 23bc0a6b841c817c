// Counts the frames that a program takes from V4L2 devices, and those that its devices dropped, for
// tests/bench/capture. Preloaded (LD_PRELOAD), so that every program is counted in the same way. The counts are in the
// file $COUNT_FRAMES/PID, one record for each file descriptor. The driver numbers frames; a number that is left out is
// a drop.
#define _GNU_SOURCE
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

struct counts {
  uint32_t frames, dropped, newest;  // newest: the number of the last frame
};
enum { kDescriptors = 256 };
static struct counts* all;

__attribute__((constructor)) static void open_counts(void) {
  const char* const folder = getenv("COUNT_FRAMES");
  char path[4096];
  if (!folder || snprintf(path, sizeof path, "%s/%d", folder, (int)getpid()) >= (int)sizeof path) return;
  const int file = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  const size_t size = kDescriptors * sizeof(struct counts);
  if (file < 0 || ftruncate(file, (off_t)size) != 0) return;
  void* const mapped = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (mapped != MAP_FAILED) all = mapped;
  close(file);
}

int ioctl(int descriptor, unsigned long request, ...) {
  va_list list;
  va_start(list, request);
  void* const argument = va_arg(list, void*);
  va_end(list);
  const int result = (int)syscall(SYS_ioctl, descriptor, request, argument);
  if (result == 0 && all && descriptor < kDescriptors) {
    struct counts* const here = &all[descriptor];
    const uint32_t asked = (uint32_t)request;  // uStreamer passes an int, whose sign fills the upper half
    if (asked == VIDIOC_DQBUF) {
      const uint32_t number = ((const struct v4l2_buffer*)argument)->sequence;
      if (here->frames++ > 0) here->dropped += number - here->newest - 1;
      here->newest = number;
    } else if (asked == VIDIOC_STREAMON) {
      here->frames = 0;  // numbers begin again
    }
  }
  return result;
}
