// Preloaded into programs under Valgrind. Replaces the C library's syscall(): openat2 becomes openat, which Valgrind
// 3.19 knows. What openat2 alone resolves, names that lead out of a folder, is not tested under Valgrind.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/syscall.h>

#include <cstdarg>
#include <cstdlib>

namespace {

/// What Valgrind must find when a test asks for it.
[[gnu::constructor]] void plant_leak() {
  if (std::getenv("NODAL_PLANT_LEAK") == nullptr) return;
  *static_cast<volatile char*>(std::malloc(1000)) = 0;
}

}  // namespace

extern "C" long syscall(long number, ...) {
  using Function = long(long, ...);
  static auto* const real = reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, "syscall"));
  std::va_list list;
  va_start(list, number);
  long words[6];
  for (long& word : words) word = va_arg(list, long);
  va_end(list);
  if (number != SYS_openat2) return real(number, words[0], words[1], words[2], words[3], words[4], words[5]);
  const auto& how = *reinterpret_cast<const open_how*>(words[2]);
  return ::openat(static_cast<int>(words[0]), reinterpret_cast<const char*>(words[1]), static_cast<int>(how.flags),
                  static_cast<mode_t>(how.mode));
}
