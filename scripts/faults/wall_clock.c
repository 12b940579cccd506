/* Sets the wall clock of the processes that are started with LD_PRELOAD=this, and of no other on the machine.
 *
 * The file named by PHIL_WALL_CLOCK holds an int64: by how many ns the wall clock is ahead of the system's. Whoever
 * reads CLOCK_REALTIME gets the shifted time; a time until which somebody waits by that clock is shifted back for the
 * kernel, as if the kernel's own clock had been set. The steady clock stays what it is.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define SECOND 1000000000LL
/* A time that is later than this many s after its origin is one of the wall clock: no machine has run for 30 years. */
#define WALL 1000000000LL

static const volatile int64_t *shared;

__attribute__((constructor)) static void open_shared(void) {
  const char *name = getenv("PHIL_WALL_CLOCK");
  int file = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
  if (file < 0) return;
  void *at = mmap(NULL, sizeof *shared, PROT_READ, MAP_SHARED, file, 0);
  close(file);
  if (at != MAP_FAILED) shared = at;
}

static void shift(struct timespec *time, int sign) {
  int64_t ahead = shared ? sign * *shared : 0;
  int64_t ns = time->tv_sec * SECOND + time->tv_nsec + ahead;
  time->tv_sec = ns / SECOND;
  time->tv_nsec = ns % SECOND;
}

int clock_gettime(clockid_t clock, struct timespec *time) {
  static int (*real)(clockid_t, struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
  int result = real ? real(clock, time) : (int)syscall(SYS_clock_gettime, clock, time);
  if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) shift(time, 1);
  return result;
}

int gettimeofday(struct timeval *restrict time, void *restrict zone) {
  (void)zone;
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return 0;
}

time_t time(time_t *out) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (out) *out = now.tv_sec;
  return now.tv_sec;
}

int pthread_cond_timedwait(pthread_cond_t *restrict c, pthread_mutex_t *restrict m, const struct timespec *restrict t) {
  static int (*real)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
  if (!real) real = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  if (!real) real = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
  struct timespec until = *t;
  if (until.tv_sec > WALL) shift(&until, -1);
  return real(c, m, &until);
}

int pthread_cond_clockwait(pthread_cond_t *c, pthread_mutex_t *m, clockid_t clock, const struct timespec *t) {
  static int (*real)(pthread_cond_t *, pthread_mutex_t *, clockid_t, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "pthread_cond_clockwait");
  struct timespec until = *t;
  if (clock == CLOCK_REALTIME) shift(&until, -1);
  return real(c, m, clock, &until);
}

int sem_timedwait(sem_t *restrict s, const struct timespec *restrict t) {
  static int (*real)(sem_t *, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "sem_timedwait");
  struct timespec until = *t;
  shift(&until, -1);
  return real(s, &until);
}

int pthread_mutex_timedlock(pthread_mutex_t *restrict m, const struct timespec *restrict t) {
  static int (*real)(pthread_mutex_t *, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
  struct timespec until = *t;
  if (until.tv_sec > WALL) shift(&until, -1);
  return real(m, &until);
}
