// The functions that the kernels of numba call, for WebAssembly. Each call of a kernel begins with `reset`.

typedef unsigned char byte;
typedef long long int64;
typedef unsigned long long uint64;

extern byte __heap_base;
static byte *top;

void reset(void) { top = &__heap_base; }

// Returns memory that the next `reset` frees. A kernel frees none: it allocates only at its start.
void *allocate(unsigned size) {
  byte *at = (byte *)(((unsigned)top + 63) & ~63u);
  top = at + size;
  unsigned pages = ((unsigned)top + 65535) >> 16, present = __builtin_wasm_memory_size(0);
  if (pages > present && __builtin_wasm_memory_grow(0, pages - present) == (__SIZE_TYPE__)-1) __builtin_trap();
  return at;
}

// The record of an array in numba's run time. Compiled code reads `data`.
typedef struct {
  int64 references;
  void *destructor, *argument, *data;
  int64 size;
} MemInfo;

void *NRT_MemInfo_alloc_aligned(uint64 size, int align) {
  MemInfo *info = allocate(sizeof(MemInfo));
  *info = (MemInfo){.references = 1, .data = allocate(size), .size = size};
  return info;
}

// Numba counts references to free arrays, which is not necessary here.
void NRT_incref(void *info) {}
void NRT_decref(void *info) {}

// Python, as `billiards_env.jit.interrupt` calls it: there is no signal.
int PyGILState_Ensure(void) { return 0; }
void PyGILState_Release(int lock) {}
int PyErr_CheckSignals(void) { return 0; }
void *PyImport_ImportModule(void *name) { return &__heap_base; }
void *PyObject_CallMethod(void *object, void *name, void *format, void *arguments) { return &__heap_base; }
void Py_DecRef(void *object) {}

// The product of two signed integers of 128 bits, which LLVM calls.
void __multi3(uint64 *result, uint64 a, int64 a_high, uint64 b, int64 b_high) {
  uint64 low = (a & 0xffffffff) * (b & 0xffffffff), middle = (a >> 32) * (b & 0xffffffff) + (low >> 32);
  uint64 other = (a & 0xffffffff) * (b >> 32) + (middle & 0xffffffff);
  result[0] = (other << 32) | (low & 0xffffffff);
  result[1] = (a >> 32) * (b >> 32) + (middle >> 32) + (other >> 32) + a * b_high + a_high * b;
}

static uint64 bits_of(double x) {
  union { double number; uint64 bits; } both = {x};
  return both.bits;
}

static double number_of(uint64 bits) {
  union { uint64 bits; double number; } both = {bits};
  return both.number;
}

// x 2^n, rounded once: only the last product can be subnormal.
double numba_ldexp(double x, int n) {
  for (; n > 1023; n -= 1023) {
    x *= 0x1p1023;
    if (n > 4000) n = 4000;
  }
  for (; n < -1022; n += 969) {  // the numbers before the last one keep 53 bits more than the smallest exponent
    x *= 0x1p-969;
    if (n < -4000) n = -4000;
  }
  return x * number_of((uint64)(1023 + n) << 52);
}

// The part of x with a size from 0.5 to 1, and the exponent of 2 by which it is multiplied.
double numba_frexp(double x, int *exponent) {
  uint64 bits = bits_of(x);
  int field = bits >> 52 & 0x7ff;
  *exponent = 0;
  if (field == 0x7ff || x == 0.0) return x;
  if (field == 0) {
    x = numba_frexp(x * 0x1p64, exponent);
    *exponent -= 64;
    return x;
  }
  *exponent = field - 1022;
  return number_of((bits & 0x800fffffffffffffULL) | 0x3fe0000000000000ULL);
}
