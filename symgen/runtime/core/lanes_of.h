/* LANES_OF(kind) defines kind_of(), the functions of a kind of lanes by their width; NULL if absent. */
#ifdef REAL_VECTORS
#define LANES_OF(KIND)                                                                                                  \
    const struct KIND##_api *KIND##_of(ptrdiff_t width) {                                                               \
        static const struct KIND##_api *const known[] = {                                                               \
            &symgen_##KIND##_2, &symgen_##KIND##_4, &symgen_##KIND##_8,                                                 \
        };                                                                                                              \
        for (size_t i = 0; i < sizeof known / sizeof *known; i++)                                                       \
            if (known[i]->width == width)                                                                               \
                return known[i];                                                                                        \
        return NULL;                                                                                                    \
    }
#else
#define LANES_OF(KIND)                                                                                                  \
    const struct KIND##_api *KIND##_of(ptrdiff_t width) {                                                               \
        (void)width;                                                                                                    \
        return NULL;                                                                                                    \
    }
#endif
