/* Runs recorded calls of compiled functions and compares every byte of their arrays and results: replay FILE.

The file has words of 64 bits in the byte order of this machine: the number of calls; for each call its function and the
numbers of arrays, arguments and results; an array is its size and the places of its content before and after; an
argument is its kind (1: the address of an array) and its value; a result is its kind (0: a value, 1: the address of an
array, 2: any) and its value or the place of the content, and the size. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ROOM ((size_t)256 << 20)
typedef uint64_t Word;
typedef struct { int64_t references; void *destructor, *argument, *data; int64_t size; } MemInfo;
extern int (*const entries[])(void *, void *, void *);
static char *data, *memory, object[64];
static size_t used;

static void *take(size_t size) {
  used = (used + 63) & ~(size_t)63;
  if (used + size > ROOM) { fprintf(stderr, "the calls need more memory\n"); exit(3); }
  used += size;
  return memory + used - size;
}

/* What compiled code calls: numba's run time, and Python for Ctrl-C. */
void *NRT_MemInfo_alloc_aligned(Word size, uint32_t align) {
  MemInfo *info = take(sizeof *info);
  *info = (MemInfo){.references = 1, .data = take(size), .size = (int64_t)size};
  return info;
}
void *NRT_MemInfo_alloc_safe_aligned(Word size, uint32_t align) { return NRT_MemInfo_alloc_aligned(size, align); }
void *NRT_MemInfo_alloc(Word size) { return NRT_MemInfo_alloc_aligned(size, 16); }
void *NRT_Allocate(Word size) { return take(size); }
void NRT_Free(void *memory) {}
void NRT_MemInfo_call_dtor(void *info) {}
void NRT_incref(void *info) {}
void NRT_decref(void *info) {}
int PyGILState_Ensure(void) { return 0; }
void PyGILState_Release(int lock) {}
int PyErr_CheckSignals(void) { return 0; }
char PyExc_RuntimeError;
void PyErr_SetString(void *kind, void *text) {}
void *PyImport_ImportModule(void *name) { return object; }
void *PyObject_CallMethod(void *of, void *name, void *format, ...) { return object; }
void Py_DecRef(void *of) {}
/* The strides of a contiguous array of another shape. */
int numba_attempt_nocopy_reshape(Word n, Word *sizes, Word *strides, Word m, Word *shape, Word *out, Word size, int order) {
  while (m--) {
    out[m] = size;
    size *= shape[m];
  }
  return 1;
}
double numba_ldexp(double x, int n) { return ldexp(x, n); }
double numba_frexp(double x, int *e) { return frexp(x, e); }

static Word other_bytes(Word call, const char *what, const char *is, const char *expected, Word size) {
  Word count = 0;
  for (Word k = 0; k < size; k++) {
    if (is[k] != expected[k] && !count++) printf("call %" PRIu64 ", %s: byte %" PRIu64 " differs\n", call, what, k);
  }
  return count;
}

int main(int count, char **names) {
  FILE *file = fopen(names[count - 1], "rb");
  fseek(file, 0, SEEK_END);
  size_t size = (size_t)ftell(file);
  rewind(file);
  data = malloc(size);
  memory = malloc(ROOM);
  if (fread(data, 1, size, file) != size) return 2;
  const Word *at = (const Word *)data, calls = *at++;
  Word other = 0, bytes = 0, compared = 0;
  for (Word call = 0; call < calls; call++) {
    Word entry = at[0], n_arrays = at[1], n_arguments = at[2], n_results = at[3], out[512] = {0}, differ = 0;
    const Word *arrays = at + 4, *arguments = arrays + 3 * n_arrays, *results = arguments + 2 * n_arguments;
    at = results + 3 * n_results;
    used = 0;
    char **copies = take(n_arrays * sizeof *copies);
    Word *slots = take(n_arguments * sizeof *slots);
    for (Word k = 0; k < n_arrays; k++) {
      copies[k] = take(arrays[3 * k] + 8);
      memcpy(copies[k], data + arrays[3 * k + 1], arrays[3 * k]);
    }
    for (Word k = 0; k < n_arguments; k++) {
      slots[k] = arguments[2 * k] == 1 ? 0 : arguments[2 * k + 1];
      if (arguments[2 * k] == 1) memcpy(slots + k, copies + arguments[2 * k + 1], sizeof *copies);
    }
    void *error = 0;
    int status = entries[entry](slots, out, &error);
    if (status != 0 && status != -2) { /* numba: 0 for a result, -2 for None */
      printf("call %" PRIu64 ": status %d\n", call, status);
      differ = 1;
    }
    for (Word k = 0; k < n_arrays; k++) {
      differ += other_bytes(call, "array", copies[k], data + arrays[3 * k + 2], arrays[3 * k]);
      compared += arrays[3 * k];
    }
    for (Word k = 0; k < n_results && !differ; k++) {
      const Word *result = results + 3 * k;
      char *content = 0;
      memcpy(&content, out + k, sizeof content);
      if (result[0] == 0) differ += other_bytes(call, "result", (char *)(out + k), (const char *)(result + 1), 8);
      if (result[0] == 1) differ += other_bytes(call, "result", content, data + result[1], result[2]);
      compared += result[0] == 0 ? 8 : result[2];
    }
    bytes += differ;
    other += differ > 0;
  }
  printf("{\"calls\": %" PRIu64 ", \"other_calls\": %" PRIu64 ", ", calls, other);
  printf("\"bytes\": %" PRIu64 ", \"other_bytes\": %" PRIu64 "}\n", compared, bytes);
  return 0;
}
