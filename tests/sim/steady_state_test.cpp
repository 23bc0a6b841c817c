// After warm-up, the frame path allocates nothing and causes no page fault and no lock: ten heads at 29.97, every set
// captured, blended and encoded, counted in the C library's functions. libturbojpeg's own allocations per picture,
// three blocks through its public interface, are counted separately and limited.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>

#include <atomic>
#include <cstdlib>

#include "firmware/calibration/calibration_store.h"
#include "firmware/rig.h"
#include "hal/sim/disk.h"
#include "tests/sim/world.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define NODAL_SANITIZED 1
#else
#define NODAL_SANITIZED 0
#endif

namespace {

struct Counted {
  std::uint64_t allocations = 0, locks = 0;
};
Counted counted;
bool counting = false;

}  // namespace

#if !NODAL_SANITIZED
extern "C" {
void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void* __libc_realloc(void* old, std::size_t bytes);
void* __libc_memalign(std::size_t alignment, std::size_t bytes);

void* malloc(std::size_t bytes) {
  counted.allocations += counting;
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  counted.allocations += counting;
  return __libc_calloc(count, bytes);
}
void* realloc(void* old, std::size_t bytes) {
  counted.allocations += counting;
  return __libc_realloc(old, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  counted.allocations += counting;
  return __libc_memalign(alignment, bytes);
}
int pthread_mutex_lock(pthread_mutex_t* mutex) {
  using Lock = int (*)(pthread_mutex_t*);
  static const auto real = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  counted.locks += counting;
  return real(mutex);
}
}
#endif

namespace nodal::swarm {
namespace {

class SteadyState : public testing::Test {
 protected:
  static Nature nature_of_ten() {
    DrawOptions options;
    options.faults = false;
    options.heads = 10;
    options.ntsc = true;
    return draw_nature(1, options);
  }
  static firmware::RigConfig config() {
    firmware::RigConfig wider = config_of(nature_of_ten());
    wider.raymap.width = 64;
    wider.raymap.height = 32;
    return wider;
  }

  void SetUp() override {
    auto store = firmware::CalibrationStore::open(disk);
    const Calibration calibration = calibration_of(nature, 0);
    ASSERT_TRUE(store && store->put(calibration) && store->set_in_force(calibration_id(calibration)));
    rig = std::make_unique<firmware::Rig>(
        config(),
        firmware::RigPorts{world.clock(), world.enumerator(), &world.trigger(), disk, {}, nullptr, {}, nullptr},
        "a rig");
    for (int i = 0; i < 10'000 && rig->blender().counts().adopted == 0; ++i) {
      rig->step_keeper();
      rig->step_blend();
    }
    ASSERT_EQ(rig->blender().counts().adopted, 1u);
  }
  void TearDown() override {
    rig->close();
    rig.reset();
  }

  /// Advances the world until the rig has made `raymaps` more raymaps; counts the frame path's calls.
  void run(std::uint64_t raymaps) {
    const std::uint64_t until = made + raymaps;
    Instant look = world.now();
    while (made < until) {
      const Event event = world.queue().next();
      if (event.at > world.now()) world.clock().advance_to(event.at);
      const bool arrived = world.on_event(event);
      if (!arrived && world.now() < look) continue;
      look = world.now() + Duration::milliseconds(5);
      if (world.queue().empty()) world.queue().plan(look, EventKind::kStep);
      rig->encoder().set_wanted(true, true);  // as control does for hosts that pull JPEGs and pixels
      step_frame_path();
      collect();
    }
  }
  void step_frame_path() {
    rusage before{}, after{};
    getrusage(RUSAGE_THREAD, &before);
    counting = true;
    rig->step_capture();
    while (rig->step_blend()) {}
    counting = false;
    const std::uint64_t ours = counted.allocations;
    counting = true;
    while (rig->step_encode()) {}
    counting = false;
    encoding += counted.allocations - ours;
    getrusage(RUSAGE_THREAD, &after);
    page_faults += static_cast<std::uint64_t>(after.ru_minflt - before.ru_minflt + after.ru_majflt - before.ru_majflt);
  }
  /// The same as the publisher.
  void collect() {
    while (const auto raymap = rig->encoder().published().take()) {
      ++made;
      ASSERT_TRUE(raymap->jpeg && !raymap->jpeg->empty());
    }
  }

  const Nature nature = nature_of_ten();
  World world{nature};
  hal::sim::SimDisk disk;
  std::unique_ptr<firmware::Rig> rig;
  std::uint64_t made = 0, page_faults = 0;
  std::uint64_t encoding = 0;  ///< the encoder's share of the allocations
};

TEST_F(SteadyState, TenThousandSets_AllocateNothingFaultNothingAndLockNothing) {
  if (NODAL_SANITIZED) GTEST_SKIP() << "a sanitizer has an allocator of its own";
  world.queue().plan(world.now(), EventKind::kStep);
  run(300);
  counted = {};
  page_faults = encoding = 0;
  const std::uint64_t sets = rig->capture().report().sets;
  run(10'000);
  EXPECT_EQ(rig->capture().report().sets - sets, 10'000u);
  EXPECT_EQ(rig->capture().report().frames.lost(), 0u);
  EXPECT_EQ(rig->capture().report().genlock.state, firmware::GenlockState::kLocked);
  EXPECT_EQ(counted.allocations - encoding, 0u);
  EXPECT_LE(encoding, 3 * 10'000u) << "libturbojpeg's own, and nothing of ours";
  EXPECT_EQ(counted.locks, 0u);
  EXPECT_EQ(page_faults, 0u);
}

TEST_F(SteadyState, AnAllocationAndALock_WouldHaveBeenCounted) {
  if (NODAL_SANITIZED) GTEST_SKIP() << "a sanitizer has an allocator of its own";
  counted = {};
  counting = true;
  void* volatile bytes = std::malloc(100);
  pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  pthread_mutex_lock(&mutex);
  counting = false;
  pthread_mutex_unlock(&mutex);
  std::free(bytes);
  EXPECT_EQ(counted.allocations, 1u);
  EXPECT_EQ(counted.locks, 1u);
}

}  // namespace
}  // namespace nodal::swarm
