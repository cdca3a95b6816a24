"""Equivalent degrees of freedom by allantools, for crates/sagnac/src/allan/freedom.rs.

pip install allantools==2024.06; python testdata/allan/edf.py > testdata/allan/edf.csv
"""
import allantools.ci as ci

print("alpha,order,phases,m,edf")
for alpha in (2, 0, -1, -2):
    for order in (2, 3):
        for phases, m in ((101, 1), (101, 5), (101, 25), (1025, 1), (1025, 16), (1025, 128), (1025, 256),
                          (100001, 100), (100001, 1000), (100001, 10000), (100001, 30000)):
            try:
                edf = ci.edf_greenhall(alpha, order, m, phases, overlapping=True, modified=False)
            except NotImplementedError:
                continue  # white phase noise with few differences: not there
            print(f"{alpha},{order},{phases},{m},{edf:.8g}")
